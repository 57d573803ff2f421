/* One range for each number of a material, whichever way it comes in: scene keys, regions, problem files, live edits.
 * The flags of `palpate prepare` are checked in tests/house/test_commands.sh. */
#include "server/scene/problem_file.h"
#include "server/scene/scene_file.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

static char folder[] = "/tmp/palpate_limits_XXXXXX";
static pal_scene plain;
static pal_prepared mesh;

typedef struct limit {
    const char *key, *short_key; /* of scenes, of problem files */
    double low, high;
} limit;
static const limit limits[] = {{"young_Pa", "E", PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA},
                               {"poisson", "nu", PAL_POISSON_MIN, PAL_POISSON_MAX},
                               {"density_kg_m3", "density", PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3}};
enum { LIMITS = sizeof limits / sizeof limits[0] };

static double *number_of(pal_material *m, int k)
{
    return k == 0 ? &m->young_Pa : k == 1 ? &m->poisson : &m->density_kg_m3;
}

/* one part in 1e7 outside or inside of a limit */
static double beside(double value, int side)
{
    return value + side * 1e-7 * fabs(value);
}

static bool is_parsed(const char *format, const char *key, double value)
{
    char text[400];
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag;
    snprintf(text, sizeof text, format, key, value);
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag);
    if (!err) pal_scene_free(loaded);
    return !err;
}

static bool is_scene_key(int k, double value)
{
    return is_parsed(
        "{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"model\": {\"name\": \"fem\"}, \"material\": {\"%s\": %.17g}}]}",
        limits[k].key, value);
}

static bool is_region_key(int k, double value)
{
    return is_parsed("{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"model\": {\"name\": \"fem\"}, \"regions\": "
                     "[{\"box\": {\"low_m\": "
                     "[-1, -1, -1], \"high_m\": [1, 1, 1]}, \"%s\": %.17g}]}]}",
                     limits[k].key, value);
}

static bool is_region(int k, double value)
{
    pal_material m = {NAN, NAN, NAN, 0, 0};
    *number_of(&m, k) = value;
    pal_body_def *def = &plain.body[0];
    def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                  .young_Pa = m.young_Pa,
                                  .poisson = m.poisson,
                                  .density_kg_m3 = m.density_kg_m3,
                                  .low_m = {-1, -1, -1},
                                  .high_m = {1, 1, 1}};
    return pal_region_check(def, 0, NULL) == PAL_ERR_OK;
}

static bool is_material(int k, double value)
{
    pal_material m = plain.body[0].material;
    *number_of(&m, k) = value;
    return pal_material_check(&m, NULL) == PAL_ERR_OK;
}

/* a live edit of a running world: outside of the range it is refused as such, inside it may still be refused for its
 * steps */
static bool is_live_edit(pal_world *world, int k, double value)
{
    pal_material m = plain.body[0].material;
    pal_diagnostic diag = {""};
    *number_of(&m, k) = value;
    return !pal_world_material(world, 0, &m, &diag) || !strstr(diag.text, "is outside");
}

static void every_way_in_has_the_same_range(void)
{
    pal_world *world = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(pal_world_create(&plain, &diag, &world) == PAL_ERR_OK);
    for (int k = 0; k < LIMITS; k++)
        for (int side = -1; side <= 1; side += 2) {
            const double edge = side < 0 ? limits[k].low : limits[k].high, in = beside(edge, -side),
                         out = beside(edge, side);
            CHECK(is_material(k, in) && !is_material(k, out));
            CHECK(is_scene_key(k, in) && !is_scene_key(k, out));
            CHECK(is_region_key(k, in) && !is_region_key(k, out));
            CHECK(is_region(k, in) && !is_region(k, out));
            CHECK(is_live_edit(world, k, in) && !is_live_edit(world, k, out));
        }
    pal_world_destroy(world);
}

/* the ratio from which a damping is derived: 0 to a thousand */
static void the_damping_ratio_has_one_range(void)
{
    static const char *const key =
        "{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"model\": {\"name\": \"fem\"}, \"material\": {\"%s\": %.17g}}]}";
    CHECK(is_parsed(key, "damping_ratio", 0) && is_parsed(key, "damping_ratio", PAL_FACTOR_MAX));
    CHECK(!is_parsed(key, "damping_ratio", -1e-9) && !is_parsed(key, "damping_ratio", 1.001 * PAL_FACTOR_MAX));
    /* the number that stands for a derived damping is none that a scene may give */
    CHECK(!is_parsed(key, "damping_1_s", PAL_DAMPING_DERIVED));
    pal_material m = {5000, 0.4, 1000, PAL_DAMPING_DERIVED, PAL_FACTOR_MAX};
    CHECK_INT(pal_material_check(&m, NULL), 0);
    m.damping_ratio = NAN;
    CHECK_INT(pal_material_check(&m, NULL), PAL_ERR_REFUSED);
}

int main(void)
{
    char path[300];
    pal_diagnostic diag = {""};
    if (!mkdtemp(folder) || !small_scene(&plain, &mesh, 6)) return 1;
    snprintf(path, sizeof path, "%s/ball.palmesh", folder);
    if (pal_prepared_save(&mesh, path, &diag)) return 1;
    RUN(every_way_in_has_the_same_range);
    RUN(the_damping_ratio_has_one_range);
    pal_prepared_free(&mesh);
    char command[400];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return check_report() + (system(command) != 0);
}
