/* Generated organs: closed, manifold, outward surfaces of genus 0, of the size and number of components that their
 * header states, the same for the same name. */
#include "server/base/vec3.h"
#include "server/mesh/geometry/organ_family.h"
#include "tests/check.h"

#include <stdlib.h>
#include <string.h>

static pal_diagnostic diag;

/* components; genus: of all together, from vertices - edges + triangles = 2 (components - genus) */
static int genus(const pal_surface *s, int *n_component)
{
    int32_t *label = malloc(sizeof *label * (size_t)s->n_tri);
    CHECK(label && !pal_surface_components(s, label, n_component));
    free(label);
    return *n_component - (s->n_vertex - s->n_tri / 2) / 2;
}

static void check_organ(const char *name)
{
    pal_generated_organ o;
    pal_surface_topology facts;
    double low[3], high[3];
    int n_component;
    REQUIRE(!pal_organ_generate(name, &o, &diag));
    CHECK(!pal_surface_check(&o.surface, &facts) && facts.closed && facts.manifold && facts.oriented);
    CHECK(pal_surface_volume(&o.surface) > 0);
    CHECK_INT(genus(&o.surface, &n_component), 0);
    CHECK_INT(n_component, 1 + o.n_island);
    CHECK(o.n_island >= 0 && o.n_island <= 3 && o.surface.n_tri <= 3000);
    pal_surface_box(&o.surface, low, high);
    const double size = pal_dist3(low, high),
                 voxel = fmax(fmax(high[0] - low[0], high[1] - low[1]), high[2] - low[2]) / o.resolution;
    CHECK(size >= 0.05 * (1 - 1e-9) && size <= 2 * (1 + 1e-9));
    CHECK(o.young_Pa >= 1e3 && o.young_Pa <= 5e4 && o.hold >= 0.05 && o.hold <= 0.3);
    CHECK(!o.gravity || size <= o.young_Pa / (20 * 9810) * (1 + 1e-9));
    CHECK(!o.hangs || o.gravity);
    printf("  %-14s %4d triangles, %d islands, %2d voxels long, volume %5.0f voxels, %.2f m, %5.0f Pa, hold %.2f%s\n",
           name, o.surface.n_tri, o.n_island, o.resolution, pal_surface_volume(&o.surface) / pow(voxel, 3), size,
           o.young_Pa, o.hold,
           o.hangs     ? ", hangs"
           : o.gravity ? ", stands"
                       : "");
    pal_surface_free(&o.surface);
}

static void ten_organs_of_each_family(void)
{
    for (int k = 0; pal_organ_family_name(k); k++)
        for (int seed = 1; seed <= PAL_FAMILY_SEEDS; seed++) {
            char name[40];
            snprintf(name, sizeof name, "%s:%d", pal_organ_family_name(k), seed);
            check_organ(name);
        }
}

static void the_same_name_gives_the_same_organ_and_another_another(void)
{
    pal_generated_organ a, b, c;
    REQUIRE(!pal_organ_generate("lobed:4", &a, &diag) && !pal_organ_generate("lobed:4", &b, &diag) &&
            !pal_organ_generate("lobed:5", &c, &diag));
    const size_t n_byte = 3 * sizeof(double) * (size_t)a.surface.n_vertex;
    CHECK(a.surface.n_vertex == b.surface.n_vertex && !memcmp(a.surface.x, b.surface.x, n_byte));
    CHECK(a.young_Pa == b.young_Pa && a.hold == b.hold);
    CHECK(a.young_Pa != c.young_Pa && a.hold != c.hold && a.surface.n_vertex != c.surface.n_vertex);
    pal_surface_free(&a.surface);
    pal_surface_free(&b.surface);
    pal_surface_free(&c.surface);
}

static void other_names_are_refused(void)
{
    static const char *const bad[] = {"", "lobed", "lobed:", "lobed:-1", "lobed:1x", "lobed:1234567890", "round:1"};
    pal_generated_organ o;
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        CHECK_INT(pal_organ_generate(bad[k], &o, &diag), PAL_ERR_REFUSED);
}

int main(void)
{
    RUN(ten_organs_of_each_family);
    RUN(the_same_name_gives_the_same_organ_and_another_another);
    RUN(other_names_are_refused);
    return check_report();
}
