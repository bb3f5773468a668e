"""A PMAC in software, with a lathe and a workpiece behind it."""
