"""Random examples may take as long as they need on a busy machine."""
from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")
