"""Where kernels run: the one place where Taichi is started."""

from mpm.runtime.device import ARCHES, Runtime, adds_doubles, running, start, stop

__all__ = ["ARCHES", "Runtime", "adds_doubles", "running", "start", "stop"]
