"""Cams and gears for the workshop: outlines in true size as SVG and DXF.

For a cam of `mechanism_sim.cams.profiles` and a gear of `mechanism_sim.gears.involute`::

    Path('cam.dxf').write_text(to_dxf(cam_outline(cam)))
    Path('gear.svg').write_text(to_svg(gear_outline(gear)))
"""
