"""Making a chair's calibration: `boards` found, cameras `solve`d, people guided (`coverage`, `live`), the `report`."""
