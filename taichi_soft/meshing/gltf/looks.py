"""Materials, textures and colours of a glTF file as trimesh visuals."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.extras import missing_packages
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.gltf.document import Document, Entry
from taichi_soft.meshing.gltf.nodes import extension
from taichi_soft.meshing.gltf.primitives import Primitive

NUMBERS = ("baseColorFactor", "metallicFactor", "roughnessFactor", "emissiveFactor", "alphaCutoff")
WORDS = ("name", "alphaMode", "doubleSided")
TEXTURES = (
    "baseColorTexture",
    "metallicRoughnessTexture",
    "normalTexture",
    "occlusionTexture",
    "emissiveTexture",
)

SOURCES = ("EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds")
"""Extensions that store the image of a texture in a format other than PNG or JPEG."""

GLOSS = "KHR_materials_pbrSpecularGlossiness"
TRANSFORM = "KHR_texture_transform"
READ = (GLOSS, TRANSFORM, *SOURCES)
ALL_SOURCES = (*SOURCES, "KHR_texture_basisu")  # some builds of Pillow cannot read these formats


class Looks:
    """Reader of the appearance of a file's primitives, as trimesh visuals.

    Attributes:
        notes: messages about images and materials that were not read.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.notes: list[str] = []
        self._materials: dict[int, Any] = {}
        self._images: dict[int, Any] = {}

    def of(self, primitive: Primitive) -> Any:
        """Return a primitive's TextureVisuals or ColorVisuals.

        The result is None for a primitive without material, texture coordinates and colours.
        """
        number = primitive.entry.get("material")
        uv = self._texture_coordinates(primitive)
        colors = _colors(primitive)
        if number is None and uv is None and colors is None:
            return None
        from trimesh.visual import ColorVisuals, TextureVisuals  # slow to import

        if number is None and uv is None:
            return ColorVisuals(vertex_colors=colors)
        visual = TextureVisuals(uv=uv, material=self._material(number))
        if colors is not None:
            visual.vertex_attributes["color"] = colors
        return visual

    def _texture_coordinates(self, primitive: Primitive) -> FloatArray | None:
        """Return the texture coordinates for the base colour, (n, 2), with v upwards, or None without any."""
        number = primitive.entry.get("material")
        material = {} if number is None else self.document.named("materials", number)
        texture = _flat(material).get("baseColorTexture", {})
        transform = extension(texture, TRANSFORM)
        uv = primitive.values(f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}", "VEC2")
        if uv is None:
            return None
        if transform:
            angle = float(transform.get("rotation", 0.0))
            scaled = uv * np.asarray(transform.get("scale", (1.0, 1.0)), dtype=np.float64)
            rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            uv = scaled @ rotation.T + np.asarray(transform.get("offset", (0.0, 0.0)), dtype=np.float64)
        uv[:, 1] = 1.0 - uv[:, 1]
        return uv

    def _material(self, number: int | None) -> Any:
        from trimesh.visual.material import PBRMaterial

        if number is None:
            return PBRMaterial()
        if number not in self._materials:
            try:
                self._materials[number] = PBRMaterial(
                    **self._arguments(self.document.named("materials", number))
                )
            except (TypeError, ValueError) as error:
                self.notes.append(
                    f"material {number} is damaged and is not read ({' '.join(str(error).split())})"
                )
                self._materials[number] = PBRMaterial()
        return self._materials[number]

    def _arguments(self, material: Entry) -> dict[str, Any]:
        flat = _flat(material)
        found = {name: np.asarray(flat[name], dtype=np.float64) for name in NUMBERS if name in flat}
        found.update({name: flat[name] for name in WORDS if name in flat})
        found.update({name: self._image(flat[name]) for name in TEXTURES if name in flat})
        return found

    def _image(self, reference: Entry) -> Any:
        """Return the pillow image of a texture. If the image cannot be read, add a note and return None."""
        texture = self.document.named("textures", reference.get("index"))
        sources = [texture.get("source"), *(extension(texture, name).get("source") for name in ALL_SOURCES)]
        reasons = []
        for number in (each for each in sources if each is not None):
            if number not in self._images:
                self._images[number] = self._opened(number)
            if not isinstance(self._images[number], str):
                return self._images[number]
            reasons.append(self._images[number])
        self._add_note(reasons[0] if reasons else f"texture {reference.get('index')} has no image")
        return None

    def _opened(self, number: int) -> Any:
        """Return image `number` as a pillow image, or a message that says why it cannot be read."""
        if missing_packages("film", "PIL"):
            return "texture images are not read without pillow: run pip install 'taichi-soft[film]'"
        from PIL import Image, UnidentifiedImageError

        entry = self.document.named("images", number)
        uri = str(entry.get("uri", "data:"))
        name = f"image {number}" if uri[:5].lower() == "data:" else repr(uri[:60])
        try:
            data = (
                self.document.view(entry["bufferView"])[0]
                if "bufferView" in entry
                else self.document.fetch(uri)
            )
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Image.DecompressionBombWarning)
                opened = Image.open(io.BytesIO(data))
                opened.load()  # a damaged image fails here, not while a frame is drawn
            return opened
        except UnidentifiedImageError:
            return f"texture {name} is not read: its format is unknown to pillow. Save it as .png or .jpg"
        except Exception as error:  # pillow's readers raise exceptions of many kinds
            return f"texture {name} is not read ({' '.join(str(error).split())[:150]})"

    def _add_note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def _colors(primitive: Primitive) -> NDArray[np.uint8] | None:
    """Return red, green, blue and alpha of the vertices, (n, 4), from 0 to 255, or None without colours."""
    rows = primitive.values("COLOR_0", "VEC3", "VEC4")
    if rows is None:
        return None
    rgba = np.full((len(rows), 4), 255, dtype=np.uint8)
    rgba[:, : rows.shape[1]] = np.rint(np.clip(np.nan_to_num(rows), 0.0, 1.0) * 255.0)
    return rgba


def _flat(material: Entry) -> Entry:
    """Return all properties of a material in one object. Specular-glossiness is converted approximately."""
    gloss = extension(material, GLOSS)
    flat = {**material, **(material.get("pbrMetallicRoughness") or {})}
    if gloss and "pbrMetallicRoughness" not in material:
        flat.update(metallicFactor=0.0, roughnessFactor=1.0 - float(gloss.get("glossinessFactor", 1.0)))
        for old, new in (("diffuseFactor", "baseColorFactor"), ("diffuseTexture", "baseColorTexture")):
            if old in gloss:
                flat[new] = gloss[old]
    return flat
