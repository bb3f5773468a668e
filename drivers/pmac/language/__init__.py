"""The PMAC language: text to statements and back, their arithmetic and their structure. Without any I/O."""
