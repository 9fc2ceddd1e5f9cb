# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand-ins for what scripted modules take from the Python modules of 3D Slicer, which Debian does not have."""
from unittest import mock


class Base:
    """Stands in for the classes of Slicer that a module inherits."""

    def __init__(self, parent=None):
        self.layout = mock.MagicMock()

    def setup(self):
        pass


class Model:
    """Stands in for vtkMRMLModelNode."""
    mesh = None

    def GetPolyData(self):
        return self.mesh

    def SetAndObservePolyData(self, mesh):
        self.mesh = mesh

    SetName = CreateDefaultDisplayNodes = mock.MagicMock()
