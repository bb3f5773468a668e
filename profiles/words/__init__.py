"""The words of what can go wrong, in English and Korean: `problem.<code>`, and the words of its facts."""
