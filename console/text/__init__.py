"""All texts of the console, in English and Korean."""
