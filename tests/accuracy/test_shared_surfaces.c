/* Every surface of ../shared/data becomes a sound tetrahedral mesh of the right volume at 30 and 60 voxels. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/voxel/voxels.h"
#include "tests/check.h"

/* volumes of ../shared/data/README.md in cubic file units; 0: none stated, the surface is open or in pieces */
static const struct known {
    const char *file;
    double volume, tolerance; /* at 60 voxels; three times that at 30 */
    const char *method;
} KNOWN[] = {
    {"aneurysm_14k.ply", 0, 0, "scanline"},
    {"biliary_tree_vhf.obj", 0, 0, "scanline"},
    {"bunny_70k_closed.ply", 0.0007549, 0.01, "scanline"},
    {"bunny_70k_scan.ply", 0.0007549, 0.01, "vote"},
    {"dragon_11k.ply", 0.0004693, 0.01, ""},
    {"dragon_203k.ply", 0.0004779, 0.01, ""},
    {"duodenum_human_8k.obj", 1.159e5, 0.01, "scanline"},
    {"gallbladder_ct_2k.ply", 8748, 0.01, "scanline"},
    {"gallbladder_vhf.obj", 5173, 0.01, "scanline"},
    {"gear_pinion_1300.off", 0.821, 0.01, "scanline"},
    {"gear_procedural_1k.stl", 1.588e5, 0.04, "scanline"},
    {"happy_16k.ply", 0.3538, 0.01, "scanline"},
    {"heart_vhf_hull_12k.obj", 5.725e5, 0.01, "scanline"},
    {"heart_vhf_parts_86k.ply", 0, 0, "winding"},
    {"kidney_ct_6k.ply", 1.578e5, 0.01, "scanline"},
    {"kidney_vhf.obj", 1.323e5, 0.01, "scanline"},
    {"large_intestine_human_20k.ply", 8.512e5, 0.01, "scanline"},
    {"liver_ct_20k.ply", 1.59e6, 0.01, "scanline"},
    {"liver_sofa_274.obj", 36.57, 0.01, "scanline"},
    {"liver_sofa_4k.obj", 39.27, 0.01, "scanline"},
    {"liver_vhf_33k.ply", 2.135e6, 0.01, "scanline"},
    {"liver_vhf_4k.obj", 2.133e6, 0.01, "scanline"},
    {"ovary_vhf.obj", 1001, 0.01, "scanline"},
    {"pancreas_vhf_open.obj", 0, 0, "vote"},
    {"sphere_114.obj", 4.908e5, 0.01, "scanline"},
    {"spleen_vhf.obj", 1.907e5, 0.01, "scanline"},
    {"stomach_188.obj", 2.713e5, 0.01, "scanline"},
    {"stomach_human_11k.obj", 2.751e5, 0.01, "scanline"},
    {"uterus_vhf.obj", 2.467e4, 0.01, "scanline"},
};

static void mesh_one(const struct known *k, const pal_surface *surface, int resolution)
{
    pal_voxel_options options = {.resolution = resolution, .border = true};
    pal_voxels voxels;
    pal_voxel_report report;
    pal_tets tets;
    pal_diagnostic diag;
    if (pal_voxels_fill(surface, &options, &voxels, &report, &diag)) {
        CHECK_FAIL("%s at %d: %s", k->file, resolution, diag.text);
        return;
    }
    double tolerance = resolution < 60 ? 3 * k->tolerance : k->tolerance;
    if (k->volume > 0 && !(fabs(report.inside_volume_m3 / k->volume - 1) <= tolerance))
        CHECK_FAIL("%s at %d: volume %g, wanted %g", k->file, resolution, report.inside_volume_m3, k->volume);
    if (k->volume > 0 && !(fabs(report.surface_volume_m3 / k->volume - 1) <= 0.005))
        CHECK_FAIL("%s at %d: surface's volume %g, wanted %g", k->file, resolution, report.surface_volume_m3,
                   k->volume);
    if (*k->method && strcmp(k->method, report.method))
        CHECK_FAIL("%s at %d: decided by %s, wanted %s", k->file, resolution, report.method, k->method);
    CHECK(!pal_voxels_split(&voxels, &tets));
    if (pal_tets_check(&tets, &diag)) CHECK_FAIL("%s at %d: %s", k->file, resolution, diag.text);
    pal_tets_free(&tets);
    pal_voxels_free(&voxels);
}

static void every_surface_becomes_a_sound_mesh_of_its_volume(void)
{
    for (size_t i = 0; i < sizeof KNOWN / sizeof *KNOWN; i++) {
        char path[128];
        snprintf(path, sizeof path, "data/%s", KNOWN[i].file);
        const char *full = check_shared(path);
        if (!full) return;
        pal_surface surface;
        pal_diagnostic diag;
        pal_mesh_file_options options = {.unit_m = 1, .weld = 0};
        if (pal_mesh_file_read(full, &options, &surface, NULL, NULL, NULL, &diag)) {
            CHECK_FAIL("%s", diag.text);
            continue;
        }
        mesh_one(&KNOWN[i], &surface, 30);
        mesh_one(&KNOWN[i], &surface, 60);
        pal_surface_free(&surface);
    }
}

int main(void)
{
    RUN(every_surface_becomes_a_sound_mesh_of_its_volume);
    return check_report();
}
