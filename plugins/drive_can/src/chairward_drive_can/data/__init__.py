"""An example DBC file, for the simulated controller and the tests."""
