"""A keyboard or switch as stop device, held switch and arm button."""
