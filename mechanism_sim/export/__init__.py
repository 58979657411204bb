"""Machines and their parts for other programs.

Cams and gears for manufacture: outlines in true size as SVG and DXF.

For a cam of `joints.cam.profiles` and a gear of `joints.mesh.involute`::

    Path('cam.dxf').write_text(to_dxf(cam_outline(cam)))
    Path('gear.svg').write_text(to_svg(gear_outline(gear)))

A cam drawn so turns clockwise; that of a `joint` turns as it does by
``cam_outline(cam).placed(joint.profile)``.

Machines for viewers and simulators: URDF, MJCF and SDF::

    Path('machine.urdf').write_text(to_urdf(machine))
    Path('machine.xml').write_text(to_mjcf(machine))
    Path('machine.sdf').write_text(to_sdf(machine))
"""
