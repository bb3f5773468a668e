"""What a planned cut is, what its motion really is, and what is said of it; `drivers.cut` plans one."""
