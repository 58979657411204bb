"""The editor of scenes: a document, its picture, the tools that draw parts, and its page.

Nothing else in the package imports it but the command `edit`.
"""
