"""Screens of the operator. The only package that imports Textual."""
