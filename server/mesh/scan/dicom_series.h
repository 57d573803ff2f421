/* DICOM series: a folder of DICOM images is converted to NIfTI-1 by dcm2niix (Li, Morgan, Ashburner, Smith & Rorden
 * 2016, doi 10.1016/j.jneumeth.2016.03.001), a program that the user has installed, into a temporary folder. It is
 * found by PATH and started without a shell. What it writes is read as any other file, untrusted. Thread: [load]. */
#ifndef PAL_MESH_SCAN_DICOM_SERIES_H
#define PAL_MESH_SCAN_DICOM_SERIES_H
#include "server/mesh/scan/label_volume.h"

/* The volume of the one series in a folder; its format is "dicom". Errors: REFUSED: dcm2niix is not installed or finds
 * no series, the folder has several volumes; those of pal_label_volume_parse. */
pal_err pal_dicom_series_read(const char *folder, pal_label_volume *out, pal_diagnostic *diag);
/* A folder as a DICOM series, a file as pal_label_volume_read. */
pal_err pal_scan_read(const char *path, pal_label_volume *out, pal_diagnostic *diag);
#endif
