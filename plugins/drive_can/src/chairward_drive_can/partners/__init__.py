"""Simulated controllers: programs that stand in for a chair on a CAN bus, for tests and for `chairward sim`."""
