/* Scenes of model adaptive_springs: surfaces as they are, shapes, supports on open edges, what is refused; what is
 * saved loads to the same. */
#include "server/mesh/geometry/procedural.h"
#include "server/sim/surface/adaptive_surface.h"
#include "tests/fixtures/scene_files.h"

#include <sys/stat.h>

/* a box of 12 triangles, 100 x 80 x 60 mm, corners at 0 */
#define BOX_VERTICES "v 0 0 0\nv 100 0 0\nv 0 80 0\nv 100 80 0\nv 0 0 60\nv 100 0 60\nv 0 80 60\nv 100 80 60\n"
#define BOX_SIDES    "f 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
static const char box[] = BOX_VERTICES "f 1 3 4 2\nf 5 6 8 7\n" BOX_SIDES;
static const char box_inward[] = BOX_VERTICES "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n";
static const char tube[] = BOX_VERTICES BOX_SIDES;
static const char small_beside[] =
    BOX_VERTICES "f 1 3 4 2\nf 5 6 8 7\n" BOX_SIDES "v 200 0 0\nv 210 0 0\nv 200 10 0\nv 200 0 10\n"
                 "f 9 11 10\nf 9 10 12\nf 9 12 11\nf 10 11 12\n";

static const pal_surface_scene adaptive = {
    .label = -1, .adaptive = true, .unit_m = 1e-3, .material = {50000, 0.45, 1000, 4, 0}};

static pal_loaded_scene *from_text(const char *text, const pal_surface_scene *options, pal_surface_scene_report *report)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    if (!write_text(in_folder("x.obj"), text)) return NULL;
    if (pal_scene_from_surface(in_folder("x.obj"), options, &loaded, report, &diag)) CHECK_FAIL("%s", diag.text);
    return loaded;
}

static void a_surface_is_taken_as_it_is(void)
{
    pal_surface_scene_report r;
    pal_surface_scene options = adaptive;
    options.n_level = 3, options.thickness_m = 0.002;
    pal_loaded_scene *loaded = from_text(box, &options, &r);
    REQUIRE(loaded != NULL);
    const pal_prepared *mesh = &loaded->mesh[0];
    CHECK_INT(mesh->surface.n_vertex, 8);
    CHECK_INT(mesh->surface.n_tri, 12);
    CHECK_INT(mesh->tets.n_tet + mesh->tets.n_node + mesh->hexes.n_hex + mesh->skin.n_vertex, 0);
    /* V' = V + E, E' = 4 E */
    CHECK_INT(r.n_level, 3);
    CHECK_INT(r.n_node[0], 8);
    CHECK_INT(r.n_spring[0], 18);
    CHECK_INT(r.n_node[1], 26);
    CHECK_INT(r.n_spring[1], 72);
    CHECK_INT(r.n_node[2], 98);
    CHECK_INT(r.n_spring[2], 288);
    CHECK_INT(r.n_open_edge, 0);
    CHECK_INT(r.n_piece, 1);
    double area = 2 * (0.1 * 0.08 + 0.1 * 0.06 + 0.08 * 0.06);
    CHECK_NEAR(r.area_m2, area, 1e-12);
    CHECK_NEAR(r.mass_kg, 1000 * 0.002 * area, 1e-12);
    CHECK_NEAR(r.volume_m3, 0.1 * 0.08 * 0.06, 1e-12);
    CHECK(r.level_byte > 0);
    const pal_body_def *body = &loaded->scene.body[0];
    CHECK_TEXT(body->model.name, "adaptive_springs");
    CHECK_TEXT(body->output.name, "surface_output");
    CHECK_INT(body->n_support, 1);
    CHECK(body->support[0].lowest);
    CHECK_NEAR(body->material.young_Pa, 50000, 0);
    pal_scene_free(loaded);
}

static void a_surface_turned_inside_out_is_turned_back(void)
{
    pal_surface_scene_report r;
    pal_loaded_scene *loaded = from_text(box_inward, &adaptive, &r);
    REQUIRE(loaded != NULL);
    CHECK_NEAR(pal_surface_volume(&loaded->mesh[0].surface), 0.1 * 0.08 * 0.06, 1e-12);
    pal_scene_free(loaded);
}

static void an_open_surface_is_held_at_its_open_edges_unless_hold_is_asked_for(void)
{
    pal_surface_scene_report r;
    pal_surface_scene options = adaptive;
    pal_loaded_scene *loaded = from_text(tube, &options, &r);
    REQUIRE(loaded != NULL);
    CHECK_INT(r.n_open_edge, 8);
    CHECK_NEAR(r.volume_m3, 0, 0);
    CHECK(loaded->scene.body[0].support[0].rim && !loaded->scene.body[0].support[0].lowest);
    pal_scene_free(loaded);
    options.hold = 0.1;
    loaded = from_text(tube, &options, &r);
    REQUIRE(loaded != NULL);
    CHECK(!loaded->scene.body[0].support[0].rim && loaded->scene.body[0].support[0].lowest);
    CHECK_NEAR(loaded->scene.body[0].support[0].fraction, 0.1, 0);
    pal_scene_free(loaded);
}

static void of_several_pieces_the_largest_can_be_kept(void)
{
    pal_surface_scene_report r;
    pal_surface_scene options = adaptive;
    pal_loaded_scene *loaded = from_text(small_beside, &options, &r);
    REQUIRE(loaded != NULL);
    CHECK_INT(r.n_piece, 2);
    CHECK_INT(r.n_node[0], 12);
    pal_scene_free(loaded);
    options.largest_only = true;
    loaded = from_text(small_beside, &options, &r);
    REQUIRE(loaded != NULL);
    CHECK_INT(r.n_piece, 1);
    CHECK_INT(r.n_node[0], 8);
    CHECK_INT(loaded->mesh[0].surface.n_tri, 12);
    pal_scene_free(loaded);
}

static void expect_refusal(const char *text, const pal_surface_scene *options, pal_err wanted, const char *sentence)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(write_text(in_folder("bad.obj"), text));
    pal_err err = pal_scene_from_surface(in_folder("bad.obj"), options, &loaded, NULL, &diag);
    CHECK_INT(err, wanted);
    CHECK(loaded == NULL);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (!strstr(diag.text, "bad.obj: line ")) CHECK_FAIL("\"%s\" does not name file and line", diag.text);
    if (strchr(diag.text, '\n')) CHECK_FAIL("\"%s\" has a line end", diag.text);
    pal_scene_free(loaded);
}

static void what_the_model_cannot_take_has_its_sentence(void)
{
    /* a third triangle on an edge, with the offer of the other way */
    static const char fin[] = BOX_VERTICES "f 1 3 4 2\nf 5 6 8 7\n" BOX_SIDES "v 50 -50 0\nf 1 2 9\n";
    expect_refusal(fin, &adaptive, PAL_ERR_REFUSED, "3 triangles");
    expect_refusal(fin, &adaptive, PAL_ERR_REFUSED, "voxels");
    /* two triangles that run the same way along their edge */
    expect_refusal("v 0 0 0\nv 100 0 0\nv 0 100 0\nv 100 100 50\nf 1 2 3\nf 2 3 4\nf 1 3 4\n", &adaptive,
                   PAL_ERR_REFUSED, "voxels");
    /* only triangles without area */
    expect_refusal("v 0 0 0\nv 100 0 0\nv 200 0 0\nf 1 2 3\n", &adaptive, PAL_ERR_REFUSED, "triangle");
    expect_refusal("v nan 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n", &adaptive, PAL_ERR_REFUSED, "triangle");
    pal_surface_scene options = adaptive;
    options.inflate_Pa = 500;
    expect_refusal(tube, &options, PAL_ERR_REFUSED, "8 open edges");
    /* 4^9 times as many faces */
    options = adaptive;
    options.n_level = 10;
    expect_refusal(small_beside, &options, PAL_ERR_BUDGET, "budget is 512 MiB");
}

static pal_loaded_scene *from_shape(const char *name, pal_surface_scene_report *report)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_surface_scene options = adaptive;
    options.shape = name;
    if (pal_scene_procedural(&options, &loaded, report, &diag)) CHECK_FAIL("%s", diag.text);
    return loaded;
}

/* Table I of paper C, and 17 x 17 */
static void the_shapes_have_the_counts_of_the_paper(void)
{
    static const struct {
        const char *name;
        int node[2], spring[2], n_open;
    } shape[] = {{"sphere", {114, 450}, {336, 1344}, 0},
                 {"stomach", {188, 746}, {558, 2232}, 0},
                 {"sheet", {289, 1089}, {800, 3136}, 64}};
    for (int k = 0; k < 3; k++) {
        pal_surface_scene_report r;
        pal_loaded_scene *loaded = from_shape(shape[k].name, &r);
        REQUIRE(loaded != NULL);
        for (int l = 0; l < 2; l++) {
            CHECK_INT(r.n_node[l], shape[k].node[l]);
            CHECK_INT(r.n_spring[l], shape[k].spring[l]);
        }
        CHECK_INT(r.n_open_edge, shape[k].n_open);
        CHECK_TEXT(loaded->scene.name, shape[k].name);
        pal_scene_free(loaded);
    }
    pal_surface_scene options = adaptive;
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    options.shape = "cube";
    CHECK_INT(pal_scene_procedural(&options, &loaded, NULL, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "no shape \"cube\"") != NULL);
}

static pal_world *world_of(const pal_scene *scene)
{
    pal_world *world = NULL;
    pal_diagnostic diag = {""};
    if (pal_world_create(scene, &diag, &world)) CHECK_FAIL("%s", diag.text);
    return world;
}

static int n_fixed(const pal_body *body, int n)
{
    int fixed = 0;
    for (int i = 0; i < n; i++) fixed += body->support[i] != PAL_FREE;
    return fixed;
}

static void a_stomach_is_held_at_both_ends_with_the_midpoints_between(void)
{
    pal_stomach s;
    pal_loaded_scene *loaded = from_shape("stomach", NULL);
    REQUIRE(loaded != NULL && !pal_stomach_make(&s));
    pal_world *world = world_of(&loaded->scene);
    REQUIRE(world != NULL);
    const pal_body *body = pal_world_body(world, 0);
    const pal_levels *levels = &body->model.adaptive->levels;
    CHECK_INT(n_fixed(body, PAL_STOMACH_VERTEX), 2 * (PAL_STOMACH_RING + 1));
    for (int k = 0; k < PAL_STOMACH_RING; k++) CHECK(body->support[s.oesophagus[k]] && body->support[s.duodenum[k]]);
    CHECK(body->support[s.oesophagus_cap] && body->support[s.duodenum_cap]);
    for (int32_t e = 0; e < levels->first_edge[1]; e++) {
        const int32_t *end = levels->edge[e].vertex;
        if (body->support[end[0]] && body->support[end[1]]) CHECK(body->support[pal_levels_edge_midpoint(levels, e)]);
    }
    pal_surface_free(&s.surface);
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

static void a_sheet_is_held_at_its_border_on_every_level_and_a_sphere_nowhere(void)
{
    pal_loaded_scene *loaded = from_shape("sheet", NULL);
    REQUIRE(loaded != NULL);
    pal_world *world = world_of(&loaded->scene);
    REQUIRE(world != NULL);
    CHECK_INT(n_fixed(pal_world_body(world, 0), 289), 64);
    CHECK_INT(n_fixed(pal_world_body(world, 0), 1089), 128);
    pal_world_destroy(world);
    pal_scene_free(loaded);
    loaded = from_shape("sphere", NULL);
    REQUIRE(loaded != NULL);
    world = world_of(&loaded->scene);
    REQUIRE(world != NULL);
    CHECK_INT(n_fixed(pal_world_body(world, 0), 450), 0);
    pal_world_destroy(world);
    /* a border that is not there */
    pal_diagnostic diag = {""};
    loaded->scene.body[0].n_support = 1;
    loaded->scene.body[0].support[0] = (pal_support_def){.rim = true};
    CHECK_INT(pal_world_create(&loaded->scene, &diag, &world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "supports[0].boundary: the surface has no open edge") != NULL);
    pal_scene_free(loaded);
}

/* pressed from the front while it refines */
static uint64_t pressed_hash(const pal_scene *scene, int n_step)
{
    pal_world *world = world_of(scene);
    if (!world) return 0;
    pal_pose pose = {.position_m = {0.03, 0, 0.06}, .quat = {1, 0, 0, 0}};
    for (int k = 0; k < n_step; k++) {
        pose.position_m[2] -= 0.0008;
        pal_world_pose(world, 0, &pose);
        pal_world_step(world, scene->step_s);
    }
    CHECK(pal_world_body(world, 0)->n_active > PAL_STOMACH_VERTEX);
    uint64_t hash = pal_world_hash(world);
    pal_world_destroy(world);
    return hash;
}

static void a_saved_scene_loads_to_the_same_world(void)
{
    pal_loaded_scene *in = from_shape("stomach", NULL), *out = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(in != NULL);
    CHECK_INT(pal_scene_save(in, in_folder("saved"), &diag), 0);
    CHECK(access(in_folder("saved/stomach.palmesh"), R_OK) == 0);
    if (pal_scene_load(in_folder("saved/scene.json"), &out, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(out != NULL);
    CHECK_INT(out->scene.body[0].n_support, 2);
    const pal_support_def *a = &in->scene.body[0].support[1], *b = &out->scene.body[0].support[1];
    CHECK(!memcmp(a->low_m, b->low_m, sizeof a->low_m) && !memcmp(a->high_m, b->high_m, sizeof a->high_m));
    uint64_t hash = pressed_hash(&in->scene, 40);
    CHECK(hash != 0);
    CHECK(pressed_hash(&out->scene, 40) == hash);
    /* and the hash does depend on what was saved */
    out->scene.body[0].material.young_Pa *= 1.0001;
    CHECK(pressed_hash(&out->scene, 40) != hash);
    pal_scene_free(in);
    pal_scene_free(out);
    in = from_shape("sheet", NULL), out = NULL;
    REQUIRE(in != NULL);
    CHECK_INT(pal_scene_save(in, in_folder("saved"), &diag), 0);
    if (pal_scene_load(in_folder("saved/scene.json"), &out, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(out != NULL);
    CHECK(out->scene.body[0].n_support == 1 && out->scene.body[0].support[0].rim);
    pal_scene_free(in);
    pal_scene_free(out);
}

#define BODY(more)  "{\"bodies\": [{\"surface\": \"x.obj\", \"units\": \"mm\", " more "}]}"
#define MODEL(keys) "\"model\": {\"name\": \"adaptive_springs\"" keys "}"

/* loads and makes a world; the refusal's sentence or "" */
static const char *try_text(const char *text, pal_loaded_scene **loaded, pal_world **world)
{
    static pal_diagnostic diag;
    diag = (pal_diagnostic){""};
    *loaded = NULL, *world = NULL;
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, loaded, &diag);
    if (!err) err = pal_world_create(&(*loaded)->scene, &diag, world);
    return err ? diag.text : "";
}

static void every_key_of_the_model_arrives(void)
{
    static const char text[] = BODY("\"material\": {\"young_Pa\": 20000, \"damping_1_s\": 2}, "
                                    "\"supports\": [{\"boundary\": true}, {\"lowest\": 0.01}], " MODEL(
                                        ", \"levels\": 3, \"start_level\": 1, \"thickness_m\": 0.002, \"mass_kg\": "
                                        "0.25, \"k_spring_N_m\": 50, "
                                        "\"c_spring_Ns_m\": 0.01, \"law\": \"paper\", \"place\": \"butterfly\", "
                                        "\"k_shape_N_m\": 4, "
                                        "\"c_shape_Ns_m\": 0.1, \"frame\": \"world\", \"refine\": true, \"memory_MB\": "
                                        "64") ", "
                                              "\"effects\": [{\"name\": \"refine\", \"force_N\": 0.1, \"speed_m_s\": "
                                              "0.2, \"curvature_1_m\": 0, \"dwell_s\": "
                                              "0.3, \"every_s\": 0.02, \"most_node\": 60, \"ramp_s\": 0.1}]");
    pal_loaded_scene *loaded;
    pal_world *world;
    REQUIRE(write_text(in_folder("x.obj"), tube));
    CHECK_TEXT(try_text(text, &loaded, &world), "");
    REQUIRE(world != NULL);
    const pal_adaptive_surface *surface = pal_world_body(world, 0)->model.adaptive;
    CHECK_INT(surface->levels.n_level, 3);
    CHECK_INT(surface->options.start_level, 1);
    CHECK_NEAR(surface->options.mass_kg, 0.25, 0);
    CHECK_INT(surface->options.law, PAL_ADAPTIVE_PAPER);
    CHECK_INT(surface->options.place, PAL_MIDPOINT_BUTTERFLY);
    CHECK_INT(surface->options.budget_byte, 64 << 20);
    /* 8 vertices and 16 edges, split once */
    CHECK_INT(surface->n_node, 24);
    static const char *const rows[] = {"edge_spring", "shape_spring", "viscous", "refine", "rk4", "surface_output"};
    for (int k = 0; k < 6; k++) {
        bool found = false;
        for (int r = 0; r < pal_world_component_count(world); r++) {
            pal_component_info info;
            pal_world_component_info(world, r, &info);
            found = found || !strcmp(info.name, rows[k]);
        }
        if (!found) CHECK_FAIL("no row %s", rows[k]);
    }
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

static void every_bad_key_has_its_sentence(void)
{
    static const struct {
        const char *text, *sentence;
    } bad[] = {
        {BODY(MODEL(", \"levels\": 0")), "bodies[0].model.levels: 0 is outside"},
        {BODY(MODEL(", \"levels\": 11")), "bodies[0].model.levels: 11 is outside"},
        {BODY(MODEL(", \"levels\": 2.5")), "bodies[0].model.levels: 2.5"},
        {BODY(MODEL(", \"start_level\": 2")), "bodies[0].model.start_level: 2"},
        {BODY(MODEL(", \"thickness_m\": 0")), "bodies[0].model.thickness_m: 0 is outside"},
        {BODY(MODEL(", \"mass_kg\": -1")), "bodies[0].model.mass_kg: -1 is outside"},
        {BODY(MODEL(", \"k_spring_N_m\": 1e999")), "bodies[0].model.k_spring_N_m: inf"},
        {BODY(MODEL(", \"law\": \"rubber\"")), "bodies[0].model.law: \"rubber\""},
        {BODY(MODEL(", \"place\": \"near\"")), "bodies[0].model.place: \"near\""},
        {BODY(MODEL(", \"frame\": \"ship\"")), "bodies[0].model.frame: \"ship\""},
        {BODY(MODEL(", \"level\": 2")), "unknown key \"level\""},
        {BODY(MODEL(", \"levels\": 10, \"memory_MB\": 64")), "the budget is 64 MiB"},
        {BODY("\"resolution\": 12, " MODEL("")), "bodies[0].resolution: model adaptive_springs has no voxels"},
        {BODY("\"supports\": [{\"boundary\": false}], " MODEL("")), "bodies[0].supports[0].boundary: can only be true"},
        {BODY("\"supports\": [{\"boundary\": 1}], " MODEL("")), "bodies[0].supports[0].boundary: is not true or false"},
        {BODY("\"supports\": [{\"boundary\": true, \"lowest\": 0.1}], " MODEL("")),
         "bodies[0].supports[0]: needs either lowest, box or boundary"},
        {BODY("\"effects\": [{\"name\": \"refine\", \"force_N\": -1}], " MODEL("")),
         "bodies[0].effects[0].force_N: -1 is outside"},
        {BODY("\"effects\": [{\"name\": \"refine\", \"dwell_s\": 1e999}], " MODEL("")),
         "bodies[0].effects[0].dwell_s: inf"},
        {BODY("\"effects\": [{\"name\": \"inflate\", \"pressure_Pa\": 100}], " MODEL("")), "8 open edges"},
        /* not JSON, so that it is refused before any threshold is compared with it */
        {BODY("\"effects\": [{\"name\": \"refine\", \"speed_m_s\": NaN}], " MODEL("")), "not JSON"},
        {"{\"bodies\": [{\"surface\": \"b.obj\", \"units\": \"mm\", \"supports\": [{\"boundary\": true}]}]}",
         "supports[0].boundary: only goes with model \"adaptive_springs\", not \"tet_springs\""},
        {"{\"bodies\": [{\"mesh\": \"saved/stomach.palmesh\"}]}",
         "\"tet_springs\" works on tetrahedra, and the mesh is a surface alone"},
    };
    REQUIRE(write_text(in_folder("x.obj"), tube) && write_text(in_folder("b.obj"), box));
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        pal_loaded_scene *loaded;
        pal_world *world;
        const char *summary = try_text(bad[k].text, &loaded, &world);
        CHECK(world == NULL);
        if (!strstr(summary, bad[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", summary, bad[k].sentence);
        if (strchr(summary, '\n')) CHECK_FAIL("\"%s\" has a line end", summary);
        pal_world_destroy(world);
        pal_scene_free(loaded);
    }
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    RUN(a_surface_is_taken_as_it_is);
    RUN(a_surface_turned_inside_out_is_turned_back);
    RUN(an_open_surface_is_held_at_its_open_edges_unless_hold_is_asked_for);
    RUN(of_several_pieces_the_largest_can_be_kept);
    RUN(what_the_model_cannot_take_has_its_sentence);
    RUN(the_shapes_have_the_counts_of_the_paper);
    RUN(a_stomach_is_held_at_both_ends_with_the_midpoints_between);
    RUN(a_sheet_is_held_at_its_border_on_every_level_and_a_sphere_nowhere);
    RUN(a_saved_scene_loads_to_the_same_world);
    RUN(every_key_of_the_model_arrives);
    RUN(every_bad_key_has_its_sentence);
    return check_report();
}
