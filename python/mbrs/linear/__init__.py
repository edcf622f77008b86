"""Equilibria, steady motions, linearisation, modes, transfer functions, responses and their sensitivities."""
