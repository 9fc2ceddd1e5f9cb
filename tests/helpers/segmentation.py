# SPDX-License-Identifier: GPL-3.0-or-later
"""Write DICOM segmentations by pydicom, right ones and wrong ones."""
import random

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

SEG, RTSTRUCT, CT = "1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.481.3", "1.2.840.10008.5.1.4.1.1.2"


def items(**members):
    made = Dataset()
    for name, value in members.items():
        setattr(made, name, value)
    return [made]


def write(path, masks, codes, affine, fractional=False, kind=SEG, syntax=ExplicitVRLittleEndian, shift=0.0):
    """Write {number: mask [i, j, k]} as a segmentation, its frames in any order and without those that are empty. Codes
    are {number: (code, code of its modifier)}."""
    lps = np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    one = Dataset()
    one.file_meta = FileMetaDataset()
    one.file_meta.MediaStorageSOPClassUID, one.file_meta.TransferSyntaxUID = kind, syntax
    one.file_meta.MediaStorageSOPInstanceUID = one.SOPInstanceUID = generate_uid()
    one.is_little_endian, one.is_implicit_VR = True, False
    one.SOPClassUID, one.Modality, one.PatientID = kind, "SEG", "synthetic"
    one.SegmentationType = "FRACTIONAL" if fractional else "BINARY"
    one.Rows, one.Columns = next(iter(masks.values())).shape[1::-1]
    one.SegmentSequence = []
    for number in masks:
        code, modifier = codes.get(number, ("10200004", ""))
        kind_of_part = items(CodeValue=code, CodingSchemeDesignator="SCT", CodeMeaning="a part")
        if modifier:
            kind_of_part[0].SegmentedPropertyTypeModifierCodeSequence = items(
                CodeValue=modifier, CodingSchemeDesignator="SCT", CodeMeaning="a side")
        one.SegmentSequence += items(SegmentNumber=number, SegmentLabel=f"segment {number}",
                                     SegmentedPropertyTypeCodeSequence=kind_of_part)
    one.SharedFunctionalGroupsSequence = items(
        PixelMeasuresSequence=items(PixelSpacing=[spacing[1], spacing[0]], SliceThickness=spacing[2],
                                    SpacingBetweenSlices=spacing[2]),
        PlaneOrientationSequence=items(ImageOrientationPatient=[*lps[:3, 0] / spacing[0], *lps[:3, 1] / spacing[1]]))
    frames = [(number, k) for number, mask in masks.items() for k in range(mask.shape[2]) if mask[:, :, k].any()]
    random.Random(3).shuffle(frames)
    one.NumberOfFrames, one.PerFrameFunctionalGroupsSequence, planes = len(frames), [], []
    for index, (number, k) in enumerate(frames):
        at = lps[:3, 3] + k * lps[:3, 2] + (shift if index == 5 else 0.0)
        one.PerFrameFunctionalGroupsSequence += items(
            PlanePositionSequence=items(ImagePositionPatient=[f"{x:.6f}" for x in at]),
            SegmentIdentificationSequence=items(ReferencedSegmentNumber=number))
        planes.append(masks[number][:, :, k].T.ravel())
    if fractional:
        one.MaximumFractionalValue, one.BitsAllocated = 200, 8
        content = (np.concatenate(planes) * 120 + 40).astype(np.uint8).tobytes()
    else:
        one.BitsAllocated = 1
        content = np.packbits(np.concatenate(planes), bitorder="little").tobytes()
    one.SamplesPerPixel, one.BitsStored = 1, one.BitsAllocated
    one.add_new((0x7FE0, 0x0010), "OB", content + bytes(len(content) % 2))
    one.save_as(path, write_like_original=False)
