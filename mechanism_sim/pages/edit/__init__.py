"""Editing scenes by touch: a document, its picture, and what gestures make of them."""
