/* Problems from files: every key of the format arrives where it belongs, every fault has its one sentence that names
 * file, entry and number. */
#include "server/scene/problem_file.h"
#include "tests/check.h"

#define REGION   "{\"type\": \"box\", \"min\": [0, 0, 0], \"max\": [1, 1, 1]}"
#define MATERIAL "{\"id\": \"a\", \"region\": {\"type\": \"all\"}, \"E\": 1000, \"nu\": 0.3}"
#define SUPPORT  "{\"type\": \"fixed\", \"region\": " REGION "}"
#define LOAD     "{\"type\": \"gravity\", \"acceleration\": [0, 0, -9.81]}"
#define CASE     "{\"id\": \"c\", \"loads\": [" LOAD "]}"
#define REFERENCE                                                                                                      \
    "{\"id\": \"r\", \"file\": \"u.csv\", \"load_case\": \"c\", \"kinematics\": \"linear\", \"law\": \"hooke\"}"

/* the parts of a good problem, one of which a test replaces */
typedef struct parts {
    const char *root, *materials, *supports, *cases, *references;
} parts;

static char *build(const parts *p)
{
    static char text[8192];
    snprintf(
        text, sizeof text,
        "{\"format\": \"palpate-reference-1\", \"surface\": \"s.obj\"%s, \"materials\": %s%s%s, \"load_cases\": %s, "
        "\"references\": %s}",
        p->root ? p->root : "", p->materials ? p->materials : "[" MATERIAL "]",
        p->supports && !*p->supports ? "" : ", \"supports\": ", p->supports ? p->supports : "[" SUPPORT "]",
        p->cases ? p->cases : "[" CASE "]", p->references ? p->references : "[" REFERENCE "]");
    return text;
}

static void expect_refusal(const char *text, const char *sentence)
{
    pal_problem *problem = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_problem_parse("p.json", text, strlen(text), "/nowhere", &problem, &diag);
    CHECK_INT(err, PAL_ERR_REFUSED);
    CHECK(problem == NULL);
    free(problem);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (strncmp(diag.text, "p.json: ", 8) != 0) CHECK_FAIL("\"%s\" does not name the file first", diag.text);
    if (strchr(diag.text, '\n')) CHECK_FAIL("\"%s\" has a line end", diag.text);
}

static pal_problem *expect_good(const char *text)
{
    pal_problem *problem = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_problem_parse("d/p.json", text, strlen(text), "/folder", &problem, &diag);
    CHECK_INT(err, PAL_ERR_OK);
    if (err) CHECK_FAIL("refused: %s", diag.text);
    return err ? NULL : problem;
}

static void the_shortest_problem_has_the_defaults(void)
{
    pal_problem *p = expect_good(build(&(parts){.references = "[]"}));
    REQUIRE(p != NULL);
    CHECK_TEXT(p->name, "p.json");
    CHECK_TEXT(p->path, "d/p.json");
    CHECK_TEXT(p->surface, "/folder/s.obj");
    CHECK_NEAR(p->unit_m, 1, 0);
    CHECK_INT(p->n_material, 1);
    CHECK(p->material[0].region.all);
    CHECK_NEAR(p->material[0].young_Pa, 1000, 0);
    CHECK_NEAR(p->material[0].poisson, 0.3, 0);
    CHECK_NEAR(p->material[0].density_kg_m3, 1000, 0);
    CHECK_INT(p->n_support, 1);
    CHECK(!p->support[0].moved);
    CHECK_NEAR(p->support[0].region.high_m[2], 1, 0);
    CHECK_INT(p->n_case, 1);
    CHECK_INT(p->n_reference, 0);
    free(p);
}

static void every_kind_of_load_and_support_is_read(void)
{
    pal_problem *p = expect_good(build(&(parts){
        .root = ", \"surface_unit\": \"mm\", \"note\": \"x\", \"geometry\": {\"teeth\": 10}",
        .supports = "[{\"type\": \"moved\", \"move\": [0, 0.5, -1], \"region\": " REGION ", \"note\": \"n\"}]",
        .cases = "[{\"id\": \"c\", \"loads\": ["
                 "{\"type\": \"dead_traction\", \"region\": " REGION
                 ", \"surface_normal\": [0, 0, -4], \"traction\": [1, 2, 3], \"area\": 2, \"total_force\": [2, 4, 6]},"
                 "{\"type\": \"dead_traction\", \"region\": {\"type\": \"all\"}, \"total_force\": [0, 0, -2]},"
                 "{\"type\": \"point\", \"point\": [1, 2, 3], \"force\": [4, 5, 6]}," LOAD "]}]"}));
    REQUIRE(p != NULL);
    const pal_problem_load *l = p->load_case[0].load;
    CHECK_NEAR(p->unit_m, 1e-3, 0);
    CHECK(p->support[0].moved);
    CHECK_NEAR(p->support[0].move_m[1], 0.5, 0);
    CHECK_NEAR(p->support[0].move_m[2], -1, 0);
    CHECK_INT(p->load_case[0].n_load, 4);
    CHECK_INT(l[0].kind, PAL_LOAD_TRACTION);
    CHECK(l[0].has_normal && l[0].has_traction && l[0].has_total && !l[0].region.all);
    CHECK_NEAR(l[0].normal[2], -1, 1e-15);
    CHECK_NEAR(l[0].traction_Pa[1], 2, 0);
    CHECK_NEAR(l[0].total_N[2], 6, 0);
    CHECK(!l[1].has_normal && !l[1].has_traction && l[1].has_total && l[1].region.all);
    CHECK_INT(l[2].kind, PAL_LOAD_POINT);
    CHECK_NEAR(l[2].point_m[0], 1, 0);
    CHECK_NEAR(l[2].force_N[2], 6, 0);
    CHECK_INT(l[3].kind, PAL_LOAD_GRAVITY);
    CHECK_NEAR(l[3].gravity_m_s2[2], -9.81, 0);
    free(p);
}

static void references_name_their_case_law_and_material(void)
{
    pal_problem *p = expect_good(build(&(parts){
        .references =
            "[" REFERENCE ", {\"id\": \"f\", \"file\": \"/abs/f.csv\", \"load_case\": \"c\", \"kinematics\": "
            "\"finite\", \"law\": \"neo-hookean\", \"E\": 5, \"nu\": 0.45, \"points\": 3, \"mesh\": "
            "{\"element\": \"C3D20R\", \"nodes\": 1, \"elements\": 2, \"coarser_nodes\": 3}, "
            "\"max_displacement\": 1, \"work_f_dot_u\": 1, \"difference_two_finest\": {\"rms\": 1, \"max\": 2}, "
            "\"order_used\": 1.5, \"estimated_error\": {\"rms\": 0.25, \"max\": 0.5}, \"note\": \"n\"}]"}));
    REQUIRE(p != NULL);
    const pal_problem_reference *r = pal_problem_reference_find(p, "r"), *f = pal_problem_reference_find(p, "f");
    REQUIRE(r && f);
    CHECK_TEXT(r->file, "/folder/u.csv");
    CHECK(!r->finite && isnan(r->young_Pa) && isnan(r->poisson) && isnan(r->estimated_rms));
    CHECK_TEXT(f->file, "/abs/f.csv");
    CHECK_TEXT(f->law, "neo-hookean");
    CHECK_TEXT(f->load_case, "c");
    CHECK(f->finite);
    CHECK_NEAR(f->young_Pa, 5, 0);
    CHECK_NEAR(f->poisson, 0.45, 0);
    CHECK_NEAR(f->estimated_rms, 0.25, 0);
    CHECK_NEAR(f->estimated_max, 0.5, 0);
    CHECK(pal_problem_case_find(p, "c") == &p->load_case[0]);
    CHECK(pal_problem_case_find(p, "r") == NULL);
    CHECK(pal_problem_reference_find(p, "c") == NULL);
    free(p);
}

static void bad_roots_are_refused(void)
{
    static const struct {
        const char *text, *sentence;
    } bad[] = {
        {"", "not JSON"},
        {"[]", "not a JSON object"},
        {"{}", "format: is missing"},
        {"{\"format\": \"palpate-reference-1\"}", "surface: is missing"},
        {"{\"format\": \"palpate-reference-2\", \"surface\": \"s\"}", "format: \"palpate-reference-2\" is not known"},
        {"{\"format\": 1, \"surface\": \"s\"}", "format: is not a text"},
        {"{\"format\": \"palpate-reference-1\", \"surface\": \"s\"}", "materials: is missing"},
        {"{\"format\": \"palpate-reference-1\", \"surface\": 3}", "surface: is not a text"},
    };
    static const struct {
        const char *root, *sentence;
    } root[] = {
        {", \"surfaces\": 1", "surfaces: unknown key; known are format"},
        {", \"name\": \"\"", "name: is empty"},
        {", \"units\": 3", "units: is not an object"},
        {", \"units\": {\"length\": \"mm\"}", "units.length: \"mm\": only \"m\" is taken"},
        {", \"units\": {\"stress\": \"MPa\"}", "units.stress: \"MPa\": only \"Pa\" is taken"},
        {", \"units\": {\"mass\": \"kg\"}", "units.mass: unknown key"},
        {", \"units\": {\"density\": 3}", "units.density: is not a text"},
        {", \"surface_unit\": \"mile\"", "surface_unit: \"mile\" is not m, cm"},
        {", \"geometry\": 3", "geometry: is not an object"},
        {", \"note\": 3", "note: is not a text"},
        {", \"undamped_natural_frequencies\": 3", "undamped_natural_frequencies: is not a list"},
        {", \"undamped_natural_frequencies\": [{\"hz\": [-1]}]",
         "undamped_natural_frequencies[0].hz: is not a list of"},
        {", \"undamped_natural_frequencies\": [{\"mu\": 1}]", "undamped_natural_frequencies[0].mu: unknown key"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) expect_refusal(bad[k].text, bad[k].sentence);
    for (size_t k = 0; k < sizeof root / sizeof root[0]; k++)
        expect_refusal(build(&(parts){.root = root[k].root}), root[k].sentence);
}

#define MATERIAL_OF(keys) "[{\"id\": \"a\", \"region\": {\"type\": \"all\"}, " keys "}]"

static void bad_materials_are_refused(void)
{
    static const struct {
        const char *text, *sentence;
    } bad[] = {
        {"[]", "materials: 0 entries, wanted at least 1"},
        {"{}", "materials: is not a list"},
        {"[{}]", "materials[0].id: is missing"},
        {"[{\"id\": \"a\", \"E\": 1, \"nu\": 0}]", "materials[0].region: is missing"},
        {MATERIAL_OF("\"nu\": 0.3"), "materials[0].E: is missing"},
        {MATERIAL_OF("\"E\": 1"), "materials[0].nu: is missing"},
        {MATERIAL_OF("\"E\": 0, \"nu\": 0.3"), "materials[0].E: 0 Pa is not a stiffness: wanted more than 0"},
        {MATERIAL_OF("\"E\": -5, \"nu\": 0.3"), "materials[0].E: -5 Pa is not a stiffness"},
        {MATERIAL_OF("\"E\": 1e999, \"nu\": 0.3"), "materials[0].E: inf Pa is not a stiffness"},
        {MATERIAL_OF("\"E\": \"1\", \"nu\": 0.3"), "materials[0].E: is not a number"},
        {MATERIAL_OF("\"E\": 1, \"nu\": 0.5"), "materials[0].nu: 0.5 is not a Poisson ratio"},
        {MATERIAL_OF("\"E\": 1, \"nu\": 0.7"), "materials[0].nu: 0.7 is not a Poisson ratio"},
        {MATERIAL_OF("\"E\": 1, \"nu\": -1"), "materials[0].nu: -1 is not a Poisson ratio"},
        {MATERIAL_OF("\"E\": 1, \"nu\": -0.99999"), "materials[0].nu: -0.99999 is nearer to -1"},
        {MATERIAL_OF("\"E\": 1, \"nu\": 0.3, \"density\": 0"), "materials[0].density: 0 is outside"},
        {MATERIAL_OF("\"E\": 1, \"nu\": 0.3, \"young\": 0"),
         "materials[0].young: unknown key; known are id, region, E"},
        {"[" MATERIAL "," MATERIAL "]", "materials[1].id: \"a\" is that of materials[0] already"},
        {"[{\"id\": \"a\", \"region\": 1, \"E\": 1, \"nu\": 0}]", "materials[0].region: is not an object"},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"ball\"}, \"E\": 1, \"nu\": 0}]",
         "materials[0].region.type: \"ball\" is not known; known are \"all\", \"box\""},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"all\", \"min\": [0, 0, 0]}, \"E\": 1, \"nu\": 0}]",
         "materials[0].region.min: only goes with type \"box\""},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"box\", \"min\": [0, 0, 0]}, \"E\": 1, \"nu\": 0}]",
         "materials[0].region.max: is missing"},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"box\", \"min\": [0, 2, 0], \"max\": [1, 1, 1]}, \"E\": 1, \"nu\": "
         "0}]",
         "materials[0].region: min[1] 2 is above max[1] 1"},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"box\", \"min\": [0, 0], \"max\": [1, 1, 1]}, \"E\": 1, \"nu\": 0}]",
         "materials[0].region.min: is not a list of three numbers"},
        {"[{\"id\": \"a\", \"region\": {\"type\": \"box\", \"min\": [0, 0, 1e99], \"max\": [1, 1, 1]}, \"E\": 1, "
         "\"nu\": "
         "0}]",
         "materials[0].region.min: number 3, 1e+99, is beyond 1e+09"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        expect_refusal(build(&(parts){.materials = bad[k].text}), bad[k].sentence);
}

static void bad_supports_and_loads_are_refused(void)
{
    static const struct {
        const char *text, *sentence;
    } support[] = {
        {"", "supports: is missing"},
        {"[{\"type\": \"held\"}]", "supports[0].type: \"held\" is not known; known are \"fixed\", \"moved\""},
        {"[{\"type\": \"fixed\"}]", "supports[0].region: is missing"},
        {"[{\"type\": \"moved\", \"region\": " REGION "}]", "supports[0].move: is missing"},
        {"[{\"type\": \"fixed\", \"move\": [0, 0, 0], \"region\": " REGION "}]", "supports[0].move: only goes with"},
        {"[" SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT "," SUPPORT
         "]",
         "supports: 9 entries, more than 8"},
    };
    static const struct {
        const char *text, *sentence;
    } load[] = {
        {"{\"type\": \"wind\"}", "load_cases[0].loads[0].type: \"wind\" is not known"},
        {"{\"type\": \"point\", \"point\": [0, 0, 0]}", "load_cases[0].loads[0].force: is missing"},
        {"{\"type\": \"point\", \"point\": [0, 0, 0], \"force\": [0, 1]}", "loads[0].force: is not a list of three"},
        {"{\"type\": \"gravity\", \"g\": 9.81}", "load_cases[0].loads[0].g: unknown key; known are type, acceleration"},
        {"{\"type\": \"dead_traction\", \"region\": " REGION "}", "loads[0]: needs traction (Pa) or total_force (N)"},
        {"{\"type\": \"dead_traction\", \"region\": " REGION
         ", \"traction\": [0, 0, 1], \"surface_normal\": [0, 0, 0]}",
         "loads[0].surface_normal: has no direction"},
        {"{\"type\": \"dead_traction\", \"region\": " REGION
         ", \"traction\": [0, 0, 1], \"area\": 2, \"total_force\": [0, 0, 3]}",
         "loads[0].total_force: 1 N off traction times area"},
        {"7", "load_cases[0].loads[0]: is not an object"},
    };
    char text[1024];
    for (size_t k = 0; k < sizeof support / sizeof support[0]; k++)
        expect_refusal(build(&(parts){.supports = support[k].text}), support[k].sentence);
    for (size_t k = 0; k < sizeof load / sizeof load[0]; k++) {
        snprintf(text, sizeof text, "[{\"id\": \"c\", \"loads\": [%s]}]", load[k].text);
        expect_refusal(build(&(parts){.cases = text}), load[k].sentence);
    }
    expect_refusal(build(&(parts){.cases = "[]"}), "load_cases: 0 entries, wanted at least 1");
    expect_refusal(build(&(parts){.cases = "[{\"id\": \"c\"}]"}),
                   "load_cases[0].loads: a load case needs at least one");
    expect_refusal(build(&(parts){.cases = "[{\"loads\": []}]"}), "load_cases[0].id: is missing");
    expect_refusal(build(&(parts){.cases = "[" CASE "," CASE "]"}), "load_cases[1].id: \"c\" is that of a load case");
}

#define REFERENCE_OF(keys) "[{\"id\": \"r\", \"file\": \"u.csv\", \"load_case\": \"c\", " keys "}]"

static void bad_references_are_refused(void)
{
    static const struct {
        const char *text, *sentence;
    } bad[] = {
        {"[{\"id\": \"c\"}]", "references[0].id: \"c\" is that of a load case already"},
        {"[" REFERENCE "," REFERENCE "]", "references[1].id: \"r\" is that of a reference already"},
        {"[{\"id\": \"r\"}]", "references[0].file: is missing"},
        {"[{\"id\": \"r\", \"file\": \"u\", \"load_case\": \"d\", \"kinematics\": \"linear\", \"law\": \"hooke\"}]",
         "references[0].load_case: there is no load case \"d\""},
        {REFERENCE_OF("\"kinematics\": \"odd\", \"law\": \"hooke\""), "references[0].kinematics: \"odd\" is not known"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"ogden\""), "references[0].law: \"ogden\" is not known"},
        {REFERENCE_OF("\"kinematics\": \"finite\", \"law\": \"hooke\""),
         "\"hooke\" does not go with finite kinematics"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"neo-hookean\""), "does not go with linear kinematics"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"nu\": 0.5"), "references[0].nu: 0.5 is not a"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"E\": -1"), "references[0].E: -1 Pa is not a"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"points\": \"x\""), "points: is not a number"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"mesh\": {\"node\": 3}"),
         "mesh.node: unknown key"},
        {REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"estimated_error\": {\"rms\": -1}"),
         "references[0].estimated_error.rms: -1 is outside"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        expect_refusal(build(&(parts){.references = bad[k].text}), bad[k].sentence);
    expect_refusal(
        build(&(parts){.materials = "[" MATERIAL ", {\"id\": \"b\", \"region\": " REGION ", \"E\": 1, \"nu\": 0}]",
                       .references = REFERENCE_OF("\"kinematics\": \"linear\", \"law\": \"hooke\", \"E\": 1")}),
        "references[0].E: the problem has 2 materials");
}

static void the_shared_references_are_read(void)
{
    static const struct {
        const char *path;
        int n_material, n_case, n_load, n_reference;
    } known[] = {{"reference/beam/problem.json", 1, 2, 1, 5},
                 {"reference/cube/problem.json", 2, 1, 1, 2},
                 {"reference/gear/problem.json", 1, 1, 2, 2}};
    for (int k = 0; k < 3; k++) {
        const char *path = check_shared(known[k].path);
        pal_problem *p = NULL;
        pal_diagnostic diag = {""};
        if (!path) continue;
        pal_err err = pal_problem_read(path, &p, &diag);
        if (err) CHECK_FAIL("refused: %s", diag.text);
        REQUIRE(!err);
        CHECK_INT(p->n_material, known[k].n_material);
        CHECK_INT(p->n_case, known[k].n_case);
        CHECK_INT(p->load_case[0].n_load, known[k].n_load);
        CHECK_INT(p->n_reference, known[k].n_reference);
        CHECK(access(p->surface, R_OK) == 0);
        CHECK(access(p->reference[0].file, R_OK) == 0);
        CHECK(p->reference[0].estimated_rms > 0);
        free(p);
    }
}

static void files_that_cannot_be_read_are_named(void)
{
    pal_problem *p = NULL;
    pal_diagnostic diag = {""};
    CHECK_INT(pal_problem_read("/nowhere/p.json", &p, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/nowhere/p.json") != NULL);
}

int main(void)
{
    RUN(the_shortest_problem_has_the_defaults);
    RUN(every_kind_of_load_and_support_is_read);
    RUN(references_name_their_case_law_and_material);
    RUN(bad_roots_are_refused);
    RUN(bad_materials_are_refused);
    RUN(bad_supports_and_loads_are_refused);
    RUN(bad_references_are_refused);
    RUN(the_shared_references_are_read);
    RUN(files_that_cannot_be_read_are_named);
    return check_report();
}
