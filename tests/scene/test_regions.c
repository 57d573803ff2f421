/* Scans in scene files: where each kind of material region holds, that a saved scene has the same material at every
 * point, the sentence of every fault, and the anatomical axes of a scan. */
#include "server/scene/scene_file.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

static char folder[] = "/tmp/palpate_regions_XXXXXX";
static pal_scene plain;
static pal_prepared mesh;

#define BODY(regions)                                                                                                  \
    "{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"model\": {\"name\": \"fem\"}, \"regions\": " regions "}]}"

static pal_loaded_scene *parse(const char *text, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = NULL;
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, &loaded, diag);
    return err ? NULL : loaded;
}

static pal_material at(const pal_loaded_scene *s, double x, double y, double z)
{
    pal_material m;
    pal_material_at(&s->scene.body[0], (double[3]){x, y, z}, &m);
    return m;
}

/* a scan of 4 x 3 x 2 voxels of 10 x 20 x 30 mm; axes: where index i, j, k point and how long, mm */
static bool write_scan(const char *name, const float axes[3][3], const float first[3], const uint8_t label[24])
{
    uint8_t head[352] = {0};
    char path[300];
    const short dim[4] = {3, 4, 3, 2};
    const int size = 348;
    const short type[2] = {2, 8}, code = 1;
    const float offset = 352, slope = 1;
    memcpy(head, &size, 4);
    memcpy(head + 40, dim, 8);
    memcpy(head + 70, type, 4);
    memcpy(head + 108, &offset, 4);
    memcpy(head + 112, &slope, 4);
    head[123] = 2;
    memcpy(head + 254, &code, 2);
    for (int r = 0; r < 3; r++) {
        const float row[4] = {axes[0][r], axes[1][r], axes[2][r], first[r]};
        memcpy(head + 280 + 16 * r, row, 16);
    }
    for (int c = 0; c < 3; c++) {
        const float edge = sqrtf(axes[c][0] * axes[c][0] + axes[c][1] * axes[c][1] + axes[c][2] * axes[c][2]);
        memcpy(head + 80 + 4 * c, &edge, 4);
    }
    memcpy(head + 344, "n+1", 4);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    bool good = file && fwrite(head, sizeof head, 1, file) == 1 && fwrite(label, 24, 1, file) == 1;
    return file && fclose(file) == 0 && good;
}

static void boxes_and_grids_hold_where_they_say(void)
{
    pal_diagnostic diag = {""};
    pal_loaded_scene *s = parse(
        BODY("[{\"box\": {\"low_m\": [-1, -1, -1], \"high_m\": [0, 1, 1]}, \"young_Pa\": 70000, \"poisson\": 0.3},"
             "{\"box\": {\"low_m\": [-1, -1, -1], \"high_m\": [-0.02, 1, 1]}, \"density_kg_m3\": 1500},"
             "{\"grid\": {\"n\": [2, 1, 1], \"low_m\": [0.02, 0, 0], \"high_m\": [0.03, 0, 0], \"poisson\": [0.1, "
             "0.2]}}]"),
        &diag);
    if (!s) CHECK_FAIL("%s", diag.text);
    REQUIRE(s != NULL);
    CHECK_INT(s->scene.body[0].n_region, 3);
    CHECK_NEAR(at(s, 0.01, 0, 0).young_Pa, 5000, 0);
    CHECK_NEAR(at(s, -0.01, 0, 0).young_Pa, 70000, 0);
    CHECK_NEAR(at(s, -0.01, 0, 0).density_kg_m3, 1000, 0);
    CHECK_NEAR(at(s, -0.03, 0, 0).density_kg_m3, 1500, 0);
    CHECK_NEAR(at(s, -0.03, 0, 0).young_Pa, 70000, 0);
    CHECK_NEAR(at(s, 0.025, 0, 0).poisson, 0.15, 1e-12);
    CHECK_NEAR(at(s, 0.9, 0, 0).poisson, 0.2, 1e-12);
    pal_scene_free(s);
}

/* index (i, j, k) of the scan is label 2 where i = 3 and k = 0 */
static const uint8_t corner_label[24] = {1, 1, 1, 2, 1, 1, 1, 2, 1, 1, 1, 2};

static void a_label_holds_in_its_voxels_however_the_scan_lies(void)
{
    static const struct {
        const char *name;
        float axes[3][3], first[3];
    } lie[3] = {{"plain.nii", {{10, 0, 0}, {0, 20, 0}, {0, 0, 30}}, {-15, -20, -15}},
                {"mirrored.nii", {{-10, 0, 0}, {0, 0, -20}, {0, 30, 0}}, {15, -15, 20}},
                {"turned.nii", {{8, 6, 0}, {-12, 16, 0}, {0, 0, 30}}, {0, -25, -15}}};
    for (int l = 0; l < 3; l++) {
        char text[512];
        pal_diagnostic diag = {""};
        REQUIRE(write_scan(lie[l].name, lie[l].axes, lie[l].first, corner_label));
        snprintf(text, sizeof text, BODY("[{\"label\": {\"volume\": \"%s\", \"value\": 2}, \"young_Pa\": 90000}]"),
                 lie[l].name);
        pal_loaded_scene *s = parse(text, &diag);
        if (!s) CHECK_FAIL("%s", diag.text);
        REQUIRE(s != NULL);
        /* points a third of a voxel from the middles of all voxels; the mesh's origin is that of the scan's frame */
        for (int v = 0; v < 24; v++) {
            const double index[3] = {v % 4 + 0.1, v / 4 % 3 - 0.1, v / 12 + 0.1};
            double x[3];
            for (int r = 0; r < 3; r++) {
                x[r] = lie[l].first[r];
                for (int c = 0; c < 3; c++) x[r] += index[c] * lie[l].axes[c][r];
                x[r] = 1e-3 * x[r] - mesh.tets.origin_m[r];
            }
            CHECK_NEAR(at(s, x[0], x[1], x[2]).young_Pa, corner_label[v] == 2 ? 90000 : 5000, 0);
        }
        CHECK_NEAR(at(s, 0.3, 0.3, 0.3).young_Pa, 5000, 0);
        pal_scene_free(s);
    }
}

static void a_saved_scene_has_the_same_material_everywhere(void)
{
    char where[300];
    pal_diagnostic diag = {""};
    const float axes[3][3] = {{-10, 0, 0}, {0, 0, -20}, {0, 30, 0}}, first[3] = {15, -15, 20};
    REQUIRE(write_scan("mirrored.nii", axes, first, corner_label));
    pal_loaded_scene *in =
        parse(BODY("[{\"box\": {\"low_m\": [-1, -1, -1], \"high_m\": [0.01, 1, 1]}, \"young_Pa\": 70000.1},"
                   "{\"label\": {\"volume\": \"mirrored.nii\", \"value\": 2}, \"poisson\": 0.31},"
                   "{\"grid\": {\"n\": [2, 2, 2], \"low_m\": [-0.04, -0.03, -0.02], \"high_m\": [0.03, 0.02, 0.04], "
                   "\"density_kg_m3\": [900, 950, 1000, 1050, 1100, 1111.1, 1200, 1300]}}]"),
              &diag);
    if (!in) CHECK_FAIL("%s", diag.text);
    REQUIRE(in != NULL);
    snprintf(where, sizeof where, "%s/saved", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), 0);
    snprintf(where, sizeof where, "%s/saved/scene.json", folder);
    pal_loaded_scene *out = NULL;
    pal_err err = pal_scene_load(where, &out, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    int n_seen[2] = {0, 0}, n_differ = 0;
    for (int k = 0; k < 20 * 20 * 20; k++) {
        const double x[3] = {-0.05 + 0.00513 * (k % 20), -0.05 + 0.00517 * (k / 20 % 20), -0.05 + 0.00511 * (k / 400)};
        pal_material a = at(in, x[0], x[1], x[2]), b = at(out, x[0], x[1], x[2]);
        n_differ += a.young_Pa != b.young_Pa || a.poisson != b.poisson || a.density_kg_m3 != b.density_kg_m3;
        n_seen[0] += a.poisson == 0.31;
        n_seen[1] += a.young_Pa == 70000.1;
    }
    CHECK_INT(n_differ, 0);
    CHECK(n_seen[0] > 100 && n_seen[0] < 4000);
    CHECK(n_seen[1] > 100 && n_seen[1] < 8000);
    pal_scene_free(in);
    pal_scene_free(out);
}

static void every_bad_region_has_its_sentence(void)
{
    static const struct {
        const char *text, *sentence;
    } bad[] = {
        {BODY("3"), "bodies[0].regions: is not a list"},
        {BODY("[{}]"), "bodies[0].regions[0]: needs one of box, label and grid"},
        {BODY("[{\"ball\": 1}]"), "bodies[0].regions[0].ball: unknown key; known are box, label, grid"},
        {BODY("[{\"box\": {\"low_m\": [0,0,0], \"high_m\": [1,1,1]}}]"),
         "regions[0]: needs young_Pa, poisson or density"},
        {BODY("[{\"box\": {\"low_m\": [0,0,0]}, \"young_Pa\": 1}]"), "regions[0].box.high_m: is missing"},
        {BODY("[{\"box\": {\"low_m\": [0,2,0], \"high_m\": [1,1,1]}, \"young_Pa\": 1}]"), "low_m[1] 2 is above high_m"},
        {BODY("[{\"box\": {\"low_m\": [0,0,0], \"high_m\": [1,1,1]}, \"young_Pa\": 0}]"), "[0].young_Pa: 0 is outside"},
        {BODY("[{\"box\": {\"low_m\": [0,0,0], \"high_m\": [1,1,1]}, \"poisson\": 0.6}]"), "poisson: 0.6 is outside"},
        {BODY("[{\"box\": {}, \"grid\": {}, \"young_Pa\": 1}]"), "needs one of box, label and grid"},
        {BODY("[{\"grid\": {\"n\": [2, 2, 0], \"low_m\": [0,0,0], \"high_m\": [1,1,1]}}]"),
         "grid.n: number 3, 0, is not a"},
        {BODY("[{\"grid\": {\"n\": [99, 99, 99], \"low_m\": [0,0,0], \"high_m\": [1,1,1]}}]"),
         "grid.n: 970299 values, more"},
        {BODY("[{\"grid\": {\"n\": [2, 1, 1], \"low_m\": [0,0,0], \"high_m\": [0,1,1], \"young_Pa\": [1, 2]}}]"),
         "grid: low_m[0] 0 is not below high_m[0] 0"},
        {BODY("[{\"grid\": {\"n\": [2, 1, 1], \"low_m\": [0,0,0], \"high_m\": [1,1,1]}}]"),
         "grid: needs young_Pa, poisson"},
        {BODY("[{\"grid\": {\"n\": [2, 1, 1], \"low_m\": [0,0,0], \"high_m\": [1,1,1], \"young_Pa\": [1]}}]"),
         "grid.young_Pa: 1 numbers, wanted 2"},
        {BODY("[{\"grid\": {\"n\": [2, 1, 1], \"low_m\": [0,0,0], \"high_m\": [1,1,1], \"young_Pa\": [1, -2]}}]"),
         "grid.young_Pa: number 2, -2, is outside"},
        {BODY("[{\"label\": {\"volume\": \"none.nii\", \"value\": 1}, \"young_Pa\": 1}]"), "regions[0].label.volume: "},
        {BODY("[{\"label\": {\"volume\": \"none.nii\"}, \"young_Pa\": 1}]"), "regions[0].label.value: is missing"},
        {BODY("[{\"label\": {\"value\": 1}, \"young_Pa\": 1}]"), "regions[0].label.volume: is missing"},
        {BODY("[{\"label\": {\"volume\": \"plain.nii\", \"value\": 7}, \"young_Pa\": 1}]"), "has no voxel of label 7"},
        {"{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"regions\": [{\"box\": {\"low_m\": [0,0,0], \"high_m\": "
         "[1,1,1]}, "
         "\"young_Pa\": 1}]}]}",
         "bodies[0].regions: model \"tet_springs\" has one material"},
    };
    const float axes[3][3] = {{10, 0, 0}, {0, 20, 0}, {0, 0, 30}}, first[3] = {-15, -20, -15};
    REQUIRE(write_scan("plain.nii", axes, first, corner_label));
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        pal_diagnostic diag = {""};
        pal_loaded_scene *s = parse(bad[k].text, &diag);
        CHECK(s == NULL);
        pal_scene_free(s);
        if (!strstr(diag.text, bad[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, bad[k].sentence);
        if (strncmp(diag.text, "s.json: ", 8) != 0) CHECK_FAIL("\"%s\" does not name the file first", diag.text);
    }
}

#define SCAN(more, surface) "{" more "\"bodies\": [{\"surface\": \"" surface "\", \"resolution\": 8}]}"

static void a_scan_gives_its_anatomical_axes_and_no_others(void)
{
    const float axes[3][3] = {{-10, 0, 0}, {0, 20, 0}, {0, 0, 30}}, first[3] = {15, -15, 20};
    uint8_t label[24];
    memset(label, 1, sizeof label);
    REQUIRE(write_scan("scan.nii", axes, first, label));
    static const struct {
        const char *text, *axes, *sentence; /* axes NULL: refused */
    } c[] = {{SCAN("", "scan.nii"), "RAS", ""},
             {SCAN("\"anatomical_axes\": \"RAS\", ", "scan.nii"), "RAS", ""},
             {SCAN("\"anatomical_axes\": \"LPS\", ", "scan.nii"), NULL, "the axes of the scan are RAS, not LPS"},
             {SCAN("\"anatomical_axes\": \"LAS\", ", "scan.nii"), NULL, "s.json: anatomical_axes: LAS is left-handed"},
             {SCAN("\"anatomical_axes\": \"RSS\", ", "scan.nii"), NULL, "s.json: anatomical_axes: RSS is not three"},
             {SCAN("\"anatomical_axes\": 3, ", "scan.nii"), NULL, "s.json: anatomical_axes: "},
             {"{\"anatomical_axes\": \"LSA\", \"bodies\": [{\"mesh\": \"ball.palmesh\"}]}", "LSA", ""},
             {"{\"bodies\": [{\"mesh\": \"ball.palmesh\"}]}", "", ""}};
    for (size_t k = 0; k < sizeof c / sizeof *c; k++) {
        pal_diagnostic diag = {""};
        pal_loaded_scene *s = parse(c[k].text, &diag), *again = NULL;
        CHECK((s != NULL) == (c[k].axes != NULL));
        if (!strstr(diag.text, c[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, c[k].sentence);
        if (!s) continue;
        CHECK_TEXT(s->scene.anatomical_axes, c[k].axes);
        char where[300], path[320];
        snprintf(where, sizeof where, "%s/axes%zu", folder, k);
        snprintf(path, sizeof path, "%s/scene.json", where);
        REQUIRE(!pal_scene_save(s, where, &diag) && !pal_scene_load(path, &again, &diag));
        CHECK_TEXT(again->scene.anatomical_axes, c[k].axes);
        pal_scene_free(again);
        pal_scene_free(s);
    }
}

int main(void)
{
    pal_diagnostic diag = {""};
    char path[300];
    if (!mkdtemp(folder) || !small_scene(&plain, &mesh, 8)) return 1;
    snprintf(path, sizeof path, "%s/ball.palmesh", folder);
    if (pal_prepared_save(&mesh, path, &diag)) return 1;
    RUN(boxes_and_grids_hold_where_they_say);
    RUN(a_label_holds_in_its_voxels_however_the_scan_lies);
    RUN(a_saved_scene_has_the_same_material_everywhere);
    RUN(a_scan_gives_its_anatomical_axes_and_no_others);
    RUN(every_bad_region_has_its_sentence);
    pal_prepared_free(&mesh);
    char command[400];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return check_report() + (system(command) != 0);
}
