/* Materials of regions: which number holds where, and what a region must not be. */
#include "server/sim/core/definition.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"

static pal_body_def def;

static pal_region *fresh(pal_region_kind kind)
{
    pal_body_default(&def, "liver", NULL);
    pal_region *r = &def.region[def.n_region++];
    *r = (pal_region){.kind = kind, .young_Pa = NAN, .poisson = NAN, .density_kg_m3 = NAN};
    for (int c = 0; c < 3; c++) r->low_m[c] = 0, r->high_m[c] = 1, r->spacing_m[c] = 0.5, r->n[c] = 3;
    return r;
}

static double young_at(double x, double y, double z)
{
    pal_material m;
    pal_material_at(&def, (double[3]){x, y, z}, &m);
    return m.young_Pa;
}

static void later_boxes_win_and_keep_what_they_do_not_give(void)
{
    fresh(PAL_REGION_BOX)->young_Pa = 1e4;
    def.region[0].density_kg_m3 = 1200;
    def.region[def.n_region++] = def.region[0];
    def.region[1].low_m[0] = 0.5;
    def.region[1].young_Pa = 2e4;
    def.region[1].density_kg_m3 = NAN;
    def.region[1].poisson = 0.3;
    CHECK_NEAR(young_at(0.2, 0.5, 0.5), 1e4, 0);
    CHECK_NEAR(young_at(0.5, 1, 0), 2e4, 0);
    CHECK_NEAR(young_at(1.01, 0.5, 0.5), 5000, 0);
    pal_material m, bare = {.young_Pa = NAN, .poisson = NAN, .density_kg_m3 = NAN};
    pal_material_at(&def, (double[3]){0.7, 0.5, 0.5}, &m);
    CHECK_NEAR(m.density_kg_m3, 1200, 0);
    CHECK_NEAR(m.poisson, 0.3, 0);
    pal_material_overlay(&def, &bare, (double[3]){0.2, 0.5, 0.5}, &m);
    CHECK(isnan(m.poisson) && m.young_Pa == 1e4);
}

static void label_is_that_of_the_voxel_around(void)
{
    uint8_t label[27] = {0};
    label[1 + 3 * 2 + 9 * 0] = 7;
    pal_region *r = fresh(PAL_REGION_LABEL);
    r->label = label, r->is = 7, r->young_Pa = 1;
    CHECK_NEAR(young_at(0.5, 1, 0), 1, 0);
    CHECK_NEAR(young_at(0.74, 1.24, -0.24), 1, 0);
    CHECK_NEAR(young_at(0.76, 1, 0), 5000, 0);
    CHECK_NEAR(young_at(0.5, 1, -0.26), 5000, 0);
    CHECK_NEAR(young_at(9, 9, 9), 5000, 0);
}

static void grid_is_trilinear_and_goes_on_beyond_its_border(void)
{
    /* 2 + 3x + 5y + 7xy + z is in the span of trilinear cells along x and y; y has one interval, z one node */
    double grid[6];
    pal_region *r = fresh(PAL_REGION_GRID);
    r->n[0] = 3, r->n[1] = 2, r->n[2] = 1;
    for (int i = 0; i < 6; i++) {
        double x = 0.5 * (i % 3), y = i / 3;
        grid[i] = 2 + 3 * x + 5 * y + 7 * x * y;
    }
    r->grid_young_Pa = grid;
    for (double x = 0; x <= 1; x += 0.125)
        for (double y = 0; y <= 1; y += 0.25) CHECK_NEAR(young_at(x, y, 0.3), 2 + 3 * x + 5 * y + 7 * x * y, 1e-14);
    CHECK_NEAR(young_at(-4, 0.5, 0), 4.5, 1e-14);
    CHECK_NEAR(young_at(8, 2, 99), 17, 1e-14);
    CHECK_INT(pal_region_check(&def, 0, NULL), 0);
}

static void refused(const char *key, const char *number)
{
    pal_diagnostic diag = {{0}};
    CHECK_INT(pal_region_check(&def, 0, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, "\"liver\" regions[0]") || !strstr(diag.text, key) || !strstr(diag.text, number))
        CHECK_FAIL("\"%s\" does not name %s %s", diag.text, key, number);
}

static void refuses_what_is_no_region(void)
{
    fresh(PAL_REGION_BOX);
    refused("young_Pa", "neither");
    fresh(PAL_REGION_BOX)->young_Pa = -3;
    refused("young_Pa", "-3");
    fresh(PAL_REGION_BOX)->poisson = 0.5;
    refused("poisson", "0.5");
    fresh(PAL_REGION_BOX)->poisson = -1;
    refused("poisson", "-1");
    fresh(PAL_REGION_BOX)->density_kg_m3 = 0;
    refused("density_kg_m3", "0");
    pal_region *r = fresh(PAL_REGION_BOX);
    r->young_Pa = 10, r->high_m[1] = -2;
    refused("high_m", "-2");
    r = fresh(PAL_REGION_LABEL);
    r->young_Pa = 10;
    refused("label", "0");
    double grid[27];
    for (int i = 0; i < 27; i++) grid[i] = 100;
    r = fresh(PAL_REGION_GRID);
    r->grid_young_Pa = grid;
    CHECK_INT(pal_region_check(&def, 0, NULL), 0);
    grid[20] = NAN;
    refused("young_Pa[20]", "nan");
    grid[20] = 1, r->n[2] = 0;
    refused("n:", "0");
}

static void scene_check_looks_at_regions(void)
{
    pal_prepared box;
    pal_diagnostic diag = {{0}};
    CHECK_INT(box_make(2, 2, 2, 0.1, &box), 0);
    pal_scene *scene = box_scene(&box, true, false);
    CHECK_INT(pal_scene_check(scene, &diag), 0);
    scene->body[0].n_region = 1;
    scene->body[0].region[0] = (pal_region){.kind = PAL_REGION_BOX, .young_Pa = 0, .poisson = NAN};
    CHECK_INT(pal_scene_check(scene, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "regions[0].young_Pa: 0"));
    scene->body[0].n_region = PAL_REGION_MAX + 1;
    CHECK_INT(pal_scene_check(scene, &diag), PAL_ERR_REFUSED);
    free(scene);
    box_free(&box);
}

int main(void)
{
    RUN(later_boxes_win_and_keep_what_they_do_not_give);
    RUN(label_is_that_of_the_voxel_around);
    RUN(grid_is_trilinear_and_goes_on_beyond_its_border);
    RUN(refuses_what_is_no_region);
    RUN(scene_check_looks_at_regions);
    return check_report();
}
