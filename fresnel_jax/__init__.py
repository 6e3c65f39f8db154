"""Fresnel optics that is accurate everywhere and differentiable everywhere, in JAX."""

from .directions import faceforward as faceforward
from .directions import reflect as reflect
from .directions import refract as refract
from .interface import Amplitudes as Amplitudes
from .interface import Powers as Powers
from .interface import amplitudes as amplitudes
from .interface import fresnel_complex as fresnel_complex
from .interface import fresnel_conductor as fresnel_conductor
from .interface import fresnel_dielectric as fresnel_dielectric
from .interface import powers as powers
from .interface import reflectance as reflectance
