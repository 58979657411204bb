"""Cams and gears for the workshop: outlines in true size as SVG and DXF."""
