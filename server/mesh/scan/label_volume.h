/* Segmented scans: label volumes of NIfTI-1 (.nii, .nii.gz), NRRD (.nrrd, raw or gzip), MetaImage (.mha, plain or
 * compressed) and INRIMAGE (.inr, .inr.gz), and the smooth closed surface of one label in metres. The bytes are
 * untrusted: every count is checked against the bytes that are there, and a compressed file may not unpack to more than
 * the header's own size.
 *
 * Axes: NIfTI's sform, else qform, else pixdim maps voxel indices to millimetres; INRIMAGE uses VX VY VZ (mm) and
 * VX index order x fastest. NRRD and MetaImage: volume_header.h; patient coordinates become those of NIfTI. A mapping
 * that mirrors keeps the surface's outward orientation. Thread: [load]. */
#ifndef PAL_MESH_SCAN_LABEL_VOLUME_H
#define PAL_MESH_SCAN_LABEL_VOLUME_H
#include "server/mesh/geometry/surface.h"

typedef struct pal_label_volume {
    int n[3];           /* voxels, x fastest                                     */
    double to_m[12];    /* 3x4 row-major: metres = to_m (i, j, k, 1), voxel centres */
    int32_t *label;     /* [n2][n1][n0]; non-integer voxels are rounded          */
    int64_t first_byte; /* of the voxels in the file, or in what is unpacked   */
    char format[16];    /* "nifti" | "inr" | "nrrd" | "metaimage" | "dicom"  */
    char axes[4];       /* where x, y and z in metres point in the patient: "RAS" where the file states it; "":
                           not known */
} pal_label_volume;

pal_err pal_label_volume_read(const char *path, pal_label_volume *out, pal_diagnostic *diag);
pal_err pal_label_volume_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_label_volume *out,
                               pal_diagnostic *diag);
void pal_label_volume_free(pal_label_volume *volume);
/* label 1 where the value is within low .. high, else 0 */
void pal_label_volume_threshold(pal_label_volume *volume, int32_t low, int32_t high);
/* does the name or content of this file look like a label volume? (to choose the reader) */
bool pal_label_volume_is(const char *path);

/* voxels and millilitres of each label, most frequent first, at most cap entries, 0 left out; number of entries */
typedef struct pal_label_count {
    int32_t label;
    int64_t n_voxel;
    double volume_m3;
} pal_label_count;
int pal_label_volume_list(const pal_label_volume *volume, pal_label_count *out, int cap);

typedef struct pal_label_surface_options {
    double blur_m;       /* Gaussian sigma; < 0: one voxel of the coarsest axis           */
    int smooth_rounds;   /* rounds of smoothing, within 3/4 of a voxel; < 0: 60           */
    int target_tri;      /* decimate to about this many triangles; 0: keep all            */
    bool all_components; /* false: keep only the largest component and drop its cavities  */
} pal_label_surface_options;

/* closed, manifold, outward-oriented surface of one label: crop, blur the 0/1 field, contour at the level that keeps
 * the label's voxel volume, smooth, decimate, set the volume. The volume error against the voxel count is within 2 %
 * for any body of more than 1000 voxels. REFUSED with the labels that exist when this one does not, BUDGET when the
 * voxels' sides are so unequal that the blur would cost far more than the label's box; MEMORY. */
pal_err pal_label_volume_surface(const pal_label_volume *volume, int32_t label,
                                 const pal_label_surface_options *options, pal_surface *out, pal_diagnostic *diag);
#endif
