"""Every command of the window as a row of one table."""
