"""Floor 2: the drive log, and one file per format that becomes one."""
