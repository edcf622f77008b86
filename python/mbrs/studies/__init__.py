"""What accuracy costs, what effects cost, whether derivatives are right."""
