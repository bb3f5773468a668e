"""Every sentence that the console says, in English and Korean."""
