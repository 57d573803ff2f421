/* Text headers of voxel images: NRRD and MetaImage (.mha). Private to this room.
 *
 * NRRD (Teem, "Definition of NRRD File Format"): `space` names where the world axes point; `space directions` are the
 * edges of a voxel, `space origin` the centre of the first voxel. MetaImage (ITK): world axes are those of DICOM (left,
 * posterior, superior); row a of TransformMatrix is the direction of voxel axis a, Offset the centre of the first
 * voxel. Both count in millimetres. The result points to the right, anterior and superior (RAS) as NIfTI does, where
 * the file states it. The bytes are untrusted. Thread: [any]. */
#ifndef PAL_MESH_SCAN_VOLUME_HEADER_H
#define PAL_MESH_SCAN_VOLUME_HEADER_H
#include "server/base/err.h"
#include "server/mesh/files/scalar_bytes.h"

typedef struct pal_volume_header {
    int64_t n[3];
    double to_m[12], slope, shift; /* value = slope stored + shift */
    size_t offset;                 /* of the first voxel           */
    pal_scalar type;
    bool big;
    bool packed;               /* the bytes from offset to the end are a zlib or gzip stream of the voxels */
    const char *format, *axes; /* axes "": not known */
} pal_volume_header;

bool pal_is_nrrd(const uint8_t *bytes, size_t n_byte);
bool pal_is_metaimage(const uint8_t *bytes, size_t n_byte);
/* Reads the beginning of a file. Errors: REFUSED (names file, line and number): a detached, ASCII or bzip2 file, other
 * than three axes, more than one value a voxel, an unknown type, a missing entry. Axes are not checked. */
pal_err pal_nrrd_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_volume_header *out,
                        pal_diagnostic *diag);
pal_err pal_metaimage_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_volume_header *out,
                             pal_diagnostic *diag);
#endif
