"""The PMAC language: parsing and formatting, arithmetic and program structure. No I/O."""
