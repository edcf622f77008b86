"""Periodic and quasi-periodic vibration by harmonic balance, with continuation."""
