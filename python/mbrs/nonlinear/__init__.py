"""Periodic and quasi-periodic vibration by harmonic balance: continuation, limit cycles, verification in time."""
