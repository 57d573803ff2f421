/* Voxels split into tetrahedra: sound ones, their boundary, and how much memory they take. */
#include "server/mesh/geometry/tets.h"
#include "server/mesh/voxel/voxels.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

#include <malloc.h>

static pal_diagnostic diag;

static pal_err fill(const pal_surface *s, int resolution, pal_voxels *out)
{
    const pal_voxel_options options = {.resolution = resolution, .border = true};
    pal_voxel_report report;
    return pal_voxels_fill(s, &options, out, &report, &diag);
}

static void split_gives_sound_tetrahedra(void)
{
    for (int shape = 0; shape < 3; shape++) {
        pal_surface s = shape == 0   ? shape_cube(0.1)
                        : shape == 1 ? shape_ball(0.1, 40, 20, 0.3)
                                     : shape_torus(0.1, 0.03, 50, 20);
        pal_voxels v;
        pal_tets t;
        REQUIRE(!fill(&s, 5 + 13 * shape, &v));
        REQUIRE(!pal_voxels_split(&v, &t));
        if (pal_tets_check(&t, &diag)) CHECK_FAIL("%s", diag.text);
        CHECK_INT(t.n_tet, 5 * (v.n_inside + v.n_border));
        CHECK_NEAR(pal_tets_volume(&t) / ((double)(v.n_inside + v.n_border) * pow(v.edge_m, 3)), 1, 1e-9);
        /* one inner tetrahedron of a third, four corners of a sixth */
        double volume = pow(v.edge_m, 3);
        for (int k = 0; k < t.n_tet; k += 97) {
            pal_tets one = {.n_tet = 1, .x = t.x, .tet = t.tet + 4 * k};
            CHECK_NEAR(pal_tets_volume(&one) / volume, k % 5 == 4 ? 1.0 / 3 : 1.0 / 6, 1e-6);
        }
        /* the boundary it wrote is the boundary that its tetrahedra have */
        pal_tets again = t;
        again.face = NULL;
        again.on_surface = NULL;
        REQUIRE(!pal_tets_find_boundary(&again));
        CHECK_INT(again.n_face, t.n_face);
        CHECK(!memcmp(again.on_surface, t.on_surface, (size_t)t.n_node));
        double enclosed[2] = {0, 0};
        for (int which = 0; which < 2; which++) {
            pal_surface hull = {.n_vertex = t.n_node, .n_tri = t.n_face, .x = t.x, .tri = which ? again.face : t.face};
            enclosed[which] = pal_surface_volume(&hull);
        }
        CHECK_NEAR(enclosed[0] / pal_tets_volume(&t), 1, 1e-9);
        CHECK_NEAR(enclosed[1] / pal_tets_volume(&t), 1, 1e-9);
        free(again.face);
        free(again.on_surface);
        pal_tets_free(&t);
        pal_voxels_free(&v);
        pal_surface_free(&s);
    }
}

static void split_takes_at_most_40_bytes_a_tetrahedron(void)
{
    pal_surface s = shape_sphere(0.1);
    pal_voxels v;
    pal_tets t;
    REQUIRE(!fill(&s, 60, &v));
    REQUIRE(!pal_voxels_split(&v, &t));
    size_t kept = malloc_usable_size(v.kind) + malloc_usable_size(t.x) + malloc_usable_size(t.tet) +
                  malloc_usable_size(t.face) + malloc_usable_size(t.on_surface);
    CHECK_LE((double)kept / t.n_tet, 40);
    pal_tets_free(&t);
    pal_voxels_free(&v);
    pal_surface_free(&s);
}

int main(void)
{
    RUN(split_gives_sound_tetrahedra);
    RUN(split_takes_at_most_40_bytes_a_tetrahedron);
    return check_report();
}
