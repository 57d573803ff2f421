"""Writes one volume of CT with oblique axes in several formats: pydicom, nibabel, and MetaImage by its specification.

usage: make_scans.py dicom FOLDER SERIES   a series of this number, one file a slice
       make_scans.py nifti FILE.nii        its axes in the sform
       make_scans.py qform FILE.nii.gz     its axes in the qform alone
       make_scans.py meta FILE.mha
Exit code 77 without python3-pydicom and python3-nibabel.
"""

import os
import sys

try:
    import nibabel
    import numpy
    import pydicom
    import pydicom.uid
except ImportError:
    sys.exit(77)

SIZE, STEP = (40, 32, 24), (1.5, 2.0, 2.5)
ORIGIN = numpy.array([-30.0, 12.0, 250.0])


def axes():
    """columns: directions of columns, rows and slices in DICOM's patient frame (LPS), rotated about x and z"""
    a, b = numpy.radians(20), numpy.radians(-15)
    about_x = numpy.array([[1, 0, 0], [0, numpy.cos(a), -numpy.sin(a)], [0, numpy.sin(a), numpy.cos(a)]])
    about_z = numpy.array([[numpy.cos(b), -numpy.sin(b), 0], [numpy.sin(b), numpy.cos(b), 0], [0, 0, 1]])
    return about_z @ about_x


def voxels():
    """Hounsfield units [x][y][z]; the body is wider on one side of every axis, so that no mirror image equals it"""
    i, j, k = numpy.meshgrid(*[numpy.arange(n) for n in SIZE], indexing="ij")
    x, y, z = (i - 18) * STEP[0], (j - 15) * STEP[1], (k - 11) * STEP[2]
    ball = (x / 20) ** 2 + (y / 22) ** 2 + (z / 19) ** 2 < 1
    knob = (x - 14) ** 2 + (y - 10) ** 2 + (z - 9) ** 2 < 81
    noise = numpy.random.default_rng(1).integers(-40, 41, SIZE)
    return numpy.where(ball | knob, 100, -900) + noise


def slice_of(values, k, series, study, place):
    d = pydicom.Dataset()
    d.file_meta = pydicom.dataset.FileMetaDataset()
    d.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    d.file_meta.MediaStorageSOPClassUID = d.SOPClassUID = "1.2.840.10008.5.1.4.1.1.2"
    d.file_meta.MediaStorageSOPInstanceUID = d.SOPInstanceUID = f"{series}.{k + 1}"
    d.is_little_endian, d.is_implicit_VR = True, False
    d.StudyInstanceUID, d.SeriesInstanceUID, d.FrameOfReferenceUID = study, series, f"{study}.9"
    d.Modality, d.SeriesNumber, d.InstanceNumber = "CT", int(series.split(".")[-1]), k + 1
    d.PatientName, d.PatientID, d.StudyDate, d.StudyTime = "A^B", "1", "20200101", "120000"
    d.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
    d.ImageOrientationPatient = [round(float(v), 12) for v in axes()[:, :2].T.ravel()]
    d.ImagePositionPatient = [round(float(v), 9) for v in place]
    d.PixelSpacing, d.SliceThickness = [STEP[1], STEP[0]], STEP[2]
    d.RescaleIntercept, d.RescaleSlope = -1024, 1
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, "MONOCHROME2"
    d.Columns, d.Rows = SIZE[:2]
    d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = 16, 16, 15, 0
    d.PixelData = (values[:, :, k].T + 1024).astype("<u2").tobytes()
    return d


def write_dicom(folder, number):
    os.makedirs(folder, exist_ok=True)
    study = "1.2.826.0.1.3680043.8.498.26"
    for k in range(SIZE[2]):
        place = ORIGIN + axes()[:, 2] * STEP[2] * k
        d = slice_of(voxels(), k, f"{study}.{number}", study, place)
        d.save_as(f"{folder}/{number}_{k:03d}.dcm", write_like_original=False)


def write_nifti(path, qform):
    to_ras = numpy.diag([-1.0, -1.0, 1.0])  # NIfTI's patient frame is RAS
    affine = numpy.eye(4)
    affine[:3, :3] = to_ras @ axes() @ numpy.diag(STEP)
    affine[:3, 3] = to_ras @ ORIGIN
    image = nibabel.Nifti1Image(voxels().astype("<i2"), affine)
    image.set_sform(affine, 0 if qform else 1)
    image.set_qform(affine, 1 if qform else 0)
    nibabel.save(image, path)


def write_meta(path):
    # TransformMatrix has the direction of each axis of voxels in a row
    words = {
        "ObjectType": "Image",
        "NDims": "3",
        "BinaryData": "True",
        "BinaryDataByteOrderMSB": "False",
        "TransformMatrix": " ".join(repr(float(v)) for v in axes().T.ravel()),
        "Offset": " ".join(repr(float(v)) for v in ORIGIN),
        "ElementSpacing": " ".join(str(v) for v in STEP),
        "DimSize": " ".join(str(v) for v in SIZE),
        "AnatomicalOrientation": "RAI",
        "ElementType": "MET_SHORT",
        "ElementDataFile": "LOCAL",
    }
    with open(path, "wb") as file:
        file.write("".join(f"{key} = {value}\n" for key, value in words.items()).encode())
        file.write(voxels().astype("<i2").tobytes(order="F"))


kind, path = sys.argv[1:3]
if kind == "dicom":
    write_dicom(path, sys.argv[3])
elif kind == "meta":
    write_meta(path)
else:
    write_nifti(path, kind == "qform")
