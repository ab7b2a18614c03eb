"""The table of hands that close on a ball here and in MuJoCo: what it measures, and which models it lists instead."""

import re

import pytest
from mesh_points import mesh, tapered
from validation.hands import compare, print_table

FINGER = """<body name="{name}" pos="0 0 {z}"><joint name="{name}" axis="0 {y} 0" range="0 1.4"/>
 <geom name="{name}_link" {geom} mass="0.02"/></body>"""
MESHED, PLAIN = 'type="mesh" mesh="link" euler="0 90 0"', 'type="capsule" size="0.007" fromto="0 0 0 0.05 0 0"'


def hand(folder, geom):
    """Write a hand of two fingers along x, 80 mm apart."""
    links = [FINGER.format(name=name, z=z, y=y, geom=geom) for name, z, y in (("low", -0.04, -1), ("high", 0.04, 1))]
    asset = mesh("link", tapered(0.008, 0.006, 0.05))
    path = folder / "hand.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><asset>{asset}</asset><worldbody>{"".join(links)}</worldbody></mujoco>'
    )
    return path


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_gap_of_hulls_that_touch_is_within_the_stated_distance_and_moves_links_by_as_much(tmp_path):
    """The hull of balls of 8 and 6 mm, 50 mm apart, differs from a capsule of 7 mm by 1 mm at its ends."""
    row = compare(hand(tmp_path, MESHED))
    cells = [cell.strip() for cell in row.text.split("|")[1:-1]]
    assert cells[1] == "2 capsule" and cells[4] == "0, 0" and row.within
    links, gap, stated = map(float, cells[7:10])
    assert 0.9 < stated < 1.5
    # One contact of a finger with one joint: its link moves by what its primitive lacks.
    assert gap <= stated and links == pytest.approx(gap, abs=0.15)
    here, there = (float(each) for each in cells[5].split(","))
    assert here == pytest.approx(there, abs=10.0)


def test_models_without_meshes_or_that_mujoco_refuses_are_listed_with_the_reason(tmp_path, capsys):
    hand(tmp_path, PLAIN)
    (tmp_path / "broken.urdf").write_text("<robot")
    assert print_table(tmp_path)
    said = capsys.readouterr().out
    assert "hand.xml: no mesh that moves collides" in said and re.search(r"broken\.urdf: .*XML", said)
