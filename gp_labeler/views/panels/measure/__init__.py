"""Rulers, angles, and distances between landmarks: the window that lists them, and the menu of one."""
