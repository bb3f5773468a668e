"""The words of what can go wrong with numbers and files: `problem.<code>`, and the words of its facts."""
