"""All scenes of contact."""

from lab.contact.scenes import colliders, edges, fast, piles, rigid, rods, ropes, sheets, shells

SCENES = {
    scene.name: scene
    for scene in (
        *edges.SCENES,
        *ropes.SCENES,
        *rods.SCENES,
        *sheets.SCENES,
        *shells.SCENES,
        *piles.SCENES,
        *rigid.SCENES,
        *fast.SCENES,
        *colliders.SCENES,
    )
}
"""All scenes by name, in the order of the table."""
