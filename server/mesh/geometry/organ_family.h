/* Generated organs: closed surfaces drawn by family and seed, for tests on bodies that nobody has looked at.
 *
 *   slender      chain of capsules, length 8 to 30 radii, the upper end bent by 40 to 110 degrees
 *   branched     2 to 5 limbs of radius 1.5 to 4 voxels that meet in one point; one of them is the foot
 *   thin-walled  ellipsoidal shell, 1 to 3 voxels thick, with one opening
 *   lobed        ball with 3 to 12 wavy grooves whose walls touch or nearly touch at the size of a voxel
 *
 * Each has 0 to 3 islands of 1 to 20 voxels beside it, above its middle. All components have genus 0. Box diagonal
 * 0.05 to 2 m, Young's modulus 1 to 50 kPa (with gravity above 9.8 kPa), supports on 5 to 30 % of the height; odd seeds
 * have gravity, and then the diagonal is at most E / (20 rho g), so that they bear their weight. All but
 * thin-walled organs under gravity hang from their support: standing, they would buckle or be crushed at a neck. The
 * same name gives the same organ on every machine (up to the rounding of its mathematical functions). Thread: [load].
 */
#ifndef PAL_MESH_GEOMETRY_ORGAN_FAMILY_H
#define PAL_MESH_GEOMETRY_ORGAN_FAMILY_H
#include "server/mesh/geometry/surface.h"

enum { PAL_FAMILY_SEEDS = 10 }; /* seeds 1 to 10 of a family make its tables; any other seed is an organ too */

typedef struct pal_generated_organ {
    pal_surface surface;
    int resolution; /* voxels along the longest axis, the size of voxel that the figures above mean */
    int n_island;
    double young_Pa, hold; /* hold: fraction of the height, from below, that is fixed */
    bool gravity, hangs;   /* hangs: gravity points away from the support          */
} pal_generated_organ;

/* "slender", "branched", "thin-walled", "lobed"; NULL: there are fewer [any] */
const char *pal_organ_family_name(int index);
/* name: "FAMILY:SEED". REFUSED: no such family, or a seed that is no whole number */
pal_err pal_organ_name_read(const char *name, int *family, uint64_t *seed, pal_diagnostic *diag);
/* the organ of that name. REFUSED: as above; MEMORY */
pal_err pal_organ_generate(const char *name, pal_generated_organ *out, pal_diagnostic *diag);
#endif
