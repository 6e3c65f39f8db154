from .interface import powers as powers, reflectance as reflectance
