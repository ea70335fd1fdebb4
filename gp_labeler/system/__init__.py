"""What the machine brings: Python packages, the Qt binding, system libraries, number formats."""
