/* Values of fields: stress, strain, energy, density, damping and paint of bodies whose values are known. */
#include "server/sim/elements/elastic_law.h"
#include "tests/fixtures/solids.h"
#include "tests/fixtures/stretched_block.h"

static double worst_error(const pal_body *body, pal_field field, double wanted)
{
    double worst = 0;
    for (int i = 0; i < body->display.n_shown; i++)
        worst = fmax(worst, fabs((double)body->display.field[field]->value[i] / wanted - 1));
    return worst;
}

/* uniaxial tension: sigma = E e, so von Mises stress is E e and energy density E e^2 / 2, everywhere */
static void stress_and_energy_of_a_stretched_block_are_those_of_uniaxial_tension(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"}, *const law[] = {"linear",
                                                                                                 "corotational",
                                                                                                 "neo_hookean"};
    for (int e = 0; e < 4; e++)
        for (int l = 0; l < 3; l++) {
            /* neo-Hookean is the linear law for small strain only; the linear law knows no rotation */
            double strain = l == 2 ? 1e-4 : 0.02, angle = l == 0 ? 0 : 0.7, bound = l == 2 ? 2e-3 : 1e-5;
            tool_scene s;
            REQUIRE(stretched(&s, element[e], law[l], strain, angle));
            double young = s.scene->body[0].material.young_Pa;
            REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_VON_MISES_PA, true, NULL));
            REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
            double stress = worst_error(s.body, PAL_FIELD_VON_MISES_PA, young * strain);
            double energy = worst_error(s.body, PAL_FIELD_ENERGY_J_M3, 0.5 * young * strain * strain);
            if (stress > bound || energy > 3 * bound) printf("  %s %s\n", element[e], law[l]);
            CHECK_LE(stress, bound);
            CHECK_LE(energy, 3 * bound);
            close_fem(&s);
        }
}

/* its largest strain is that of x, its volume (1 + e) (1 - nu e)^2 of what it was, whatever law and turn */
static void strain_and_distortion_of_a_stretched_block_are_exact(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"}, *const law[] = {"linear",
                                                                                                 "corotational",
                                                                                                 "neo_hookean"};
    for (int k = 0; k < 12; k++) {
        const double strain = 0.03, angle = k % 3 == 0 ? 0 : 0.7;
        tool_scene s;
        REQUIRE(stretched(&s, element[k / 3], law[k % 3], strain, angle));
        double across = 1 - s.scene->body[0].material.poisson * strain;
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
        CHECK_LE(worst_error(s.body, PAL_FIELD_YOUNG_PA, s.scene->body[0].material.young_Pa), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DENSITY_KG_M3, s.scene->body[0].material.density_kg_m3), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, strain), 2e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, (1 + strain) * across * across - 1), 2e-5);
        close_fem(&s);
    }
}

/* the tetrahedra of a block of springs moved by F, turned */
static void strain_and_distortion_of_springs_are_those_of_their_tetrahedra(void)
{
    const double stretch[3] = {1.05, 0.97, 1.01}, c = cos(0.9), n = sin(0.9), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    for (int i = 0; i < s.body->n_dof; i++) {
        double at[3];
        for (int a = 0; a < 3; a++) at[a] = s.body->x_rest[3 * i + a] * stretch[a];
        pal_mul33(s.body->x + 3 * (size_t)i, turn, at);
    }
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, 0.05), 1e-6);
    CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, stretch[0] * stretch[1] * stretch[2] - 1), 1e-6);
    tool_scene_close(&s);
}

/* tetrahedra for sections: each upright, together the volume inside the shown surface at rest */
static void fills_the_solid(const pal_world *world)
{
    pal_shown shown;
    pal_world_shown(world, 0, &shown);
    REQUIRE(shown.n_tet > 0);
    double sum = 0, min_m3 = 1, inside = 0;
    for (int t = 0; t < shown.n_tet; t++) {
        const int32_t *node = shown.tet + 4 * (size_t)t;
        double edge[3][3], normal[3];
        for (int k = 0; k < 3; k++)
            pal_sub3(edge[k], shown.node_rest_m + 3 * (size_t)node[k + 1], shown.node_rest_m + 3 * (size_t)node[0]);
        pal_cross3(normal, edge[0], edge[1]);
        const double volume = pal_dot3(normal, edge[2]) / 6;
        sum += volume, min_m3 = fmin(min_m3, volume);
    }
    for (int t = 0; t < shown.n_tri; t++) {
        double x[3][3], normal[3];
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) x[k][c] = (double)shown.rest_m[3 * shown.tri[3 * t + k] + c];
        pal_cross3(normal, x[0], x[1]);
        inside += pal_dot3(normal, x[2]) / 6;
    }
    CHECK(min_m3 > 0);
    CHECK_NEAR(sum / inside, 1, 0.02);
}

/* a block of control cells whose points are moved by F, which its nodes follow to the digit: one stretch out and one
 * in, then pressed from all sides; turned */
static void strain_and_distortion_of_a_solid_are_exact(void)
{
    const double stretch[2][3] = {{1.05, 0.97, 1.01}, {0.98, 0.98, 0.98}}, wanted[2] = {0.05, -0.02};
    for (int k = 0; k < 2; k++) {
        const double c = cos(0.9), n = sin(0.9), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
        pal_cells cells = solid_bricks(2, 2, 2, 0.05, 0.05, 0.05);
        pal_surface surface = {0};
        tool_scene s = {.scene = calloc(1, sizeof *s.scene)};
        REQUIRE(s.scene && !pal_cells_boundary(&cells, &surface, NULL, NULL));
        REQUIRE(!pal_prepared_surface(&surface, &s.mesh));
        pal_surface_free(&surface);
        pal_scene_default(s.scene);
        s.scene->n_body = 1;
        pal_body_default_cells(&s.scene->body[0], "clay", &s.mesh, &cells);
        pal_entry_put_number(&s.scene->body[0].model, "levels", 1, NULL);
        REQUIRE(tool_scene_open(&s));
        for (int i = 0; i < s.body->n_dof; i++) {
            double at[3];
            for (int a = 0; a < 3; a++) at[a] = s.body->x_rest[3 * i + a] * stretch[k][a];
            pal_mul33(s.body->x + 3 * (size_t)i, turn, at);
        }
        pal_world_invalidate_limits(s.world, 0);
        CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_STIFFNESS_J));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
        CHECK_LE(worst_error(s.body, PAL_FIELD_YOUNG_PA, s.scene->body[0].material.young_Pa), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, wanted[k]), 1e-6);
        if (k == 0) fills_the_solid(s.world);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, stretch[k][0] * stretch[k][1] * stretch[k][2] - 1), 1e-6);
        tool_scene_close(&s);
        pal_cells_free(&cells);
    }
}

/* a slab of 4 x 3 x 2 cells, 10 mm each, of 1000 kg/m3, and of 2500 where x is above the plane between the second and
 * the third layer of cells: nodes on that plane have a mean of both */
static bool half_heavy_slab(tool_scene *s, const char *element, double damping_1_s)
{
    static pal_region heavy = {.kind = PAL_REGION_BOX, .young_Pa = NAN, .poisson = NAN, .density_kg_m3 = 2500};
    pal_diagnostic diag = {""};
    if (!slab_scene(s, 4, 3, 2, 0.01, 1, 0.01, 15) || pal_hexes_find(&s->mesh.tets, &s->mesh.hexes, &diag))
        return false;
    pal_body_def *def = &s->scene->body[0];
    for (int c = 0; c < 3; c++) heavy.low_m[c] = c == 0 ? 0.02 : -1, heavy.high_m[c] = 1;
    def->region[def->n_region++] = heavy;
    def->material.density_kg_m3 = 1000;
    def->material.damping_1_s = damping_1_s;
    if (element) {
        pal_entry_init(&def->model, "model", "fem");
        pal_entry_put_text(&def->model, "element", element, NULL);
    }
    return tool_scene_open(s);
}

static void density_is_that_of_the_regions(void)
{
    static const char *const element[] = {NULL, "tet4", "tet10", "hex8", "hex8_bbar"};
    for (int e = 0; e < 5; e++) {
        tool_scene s;
        int n_light = 0, n_heavy = 0, n_between = 0;
        REQUIRE(half_heavy_slab(&s, element[e], 0));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
        for (int i = 0; i < s.body->display.n_shown; i++) {
            const double x = s.mesh.surface.x[3 * (size_t)i],
                         at = (double)s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->value[i];
            n_light += x<0.019, n_heavy += x> 0.021, n_between += fabs(x - 0.02) < 1e-9;
            if (x < 0.019) CHECK_NEAR(at, 1000, 1e-3);
            if (x > 0.021) CHECK_NEAR(at, 2500, 1e-3);
            if (fabs(x - 0.02) < 1e-9) CHECK(at > 1000.1 && at < 2499.9);
        }
        CHECK(n_light > 0 && n_heavy > 0 && n_between > 0);
        /* another material scales all of it */
        pal_material to = s.scene->body[0].material;
        to.density_kg_m3 = 1500;
        CHECK_INT(pal_world_material(s.world, 0, &to, NULL), 0);
        CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, false, NULL), 0);
        CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL), 0);
        double sum_kg = 0, min = INFINITY;
        for (int i = 0; i < s.body->n_dof; i++) sum_kg += s.body->mass_kg[i];
        for (int i = 0; i < s.body->display.n_shown; i++)
            min = fmin(min, (double)s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->value[i]);
        CHECK_NEAR(sum_kg, 1.5 * (1000 + 2500) / 2 * 24e-6, 1e-9);
        CHECK_NEAR(min, 1500, 1e-3);
        close_fem(&s);
    }
}

/* the rate of the component viscous; a body without it has no such field */
static void damping_is_the_rate_that_acts(void)
{
    tool_scene s;
    pal_diagnostic diag = {""};
    REQUIRE(half_heavy_slab(&s, "tet4", 7.5));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_DAMPING_1_S, 7.5), 1e-6);
    close_fem(&s);
    REQUIRE(half_heavy_slab(&s, "tet4", 0));
    CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_DAMPING_1_S));
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "damping"));
    close_fem(&s);
    /* derived from the lowest frequency */
    REQUIRE(half_heavy_slab(&s, "tet4", PAL_DAMPING_DERIVED));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_DAMPING_1_S, s.body->damping_1_s), 1e-6);
    close_fem(&s);
}

/* A stroke over one corner of a block of control cells, read back from the fields: the factor to the digit where its
 * weight is 1 around a node's elements, nothing where it is 0, and between both elsewhere */
static void painted_material_is_read_back(void)
{
    pal_cells cells = solid_bricks(16, 2, 2, 0.02, 0.02, 0.02);
    pal_surface surface = {0};
    tool_scene s = {.scene = calloc(1, sizeof *s.scene)};
    const pal_stroke stroke = {.radius_m = 0.24, .softness = 0.8, .young_factor = 4, .density_factor = 2};
    REQUIRE(s.scene && !pal_cells_boundary(&cells, &surface, NULL, NULL));
    REQUIRE(!pal_prepared_surface(&surface, &s.mesh));
    pal_surface_free(&surface);
    pal_scene_default(s.scene);
    s.scene->n_body = 1;
    pal_body_def *def = &s.scene->body[0];
    pal_body_default_cells(def, "clay", &s.mesh, &cells);
    pal_entry_put_number(&def->model, "levels", 1, NULL);
    pal_stroke at_end = stroke;
    memcpy(at_end.at_m, cells.x, sizeof at_end.at_m);
    def->stroke = &at_end, def->n_stroke = 1;
    REQUIRE(tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
    /* of a node's shape function: the diagonal of two elements of half a cell each way */
    const double core = 0.2 * stroke.radius_m, band = stroke.radius_m - core, reach = 0.02 * sqrt(3);
    int n_full = 0, n_none = 0, n_between = 0;
    for (int i = 0; i < s.body->n_node; i++) {
        const double r = pal_dist3(s.body->node_rest + 3 * (size_t)i, at_end.at_m),
                     young = s.body->display.field[PAL_FIELD_YOUNG_PA]->node[i] / def->material.young_Pa,
                     density = s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->node[i] / def->material.density_kg_m3;
        CHECK(young > 1 - 1e-6 && young < 4 + 1e-6 && density > 1 - 1e-6 && density < 2 + 1e-6);
        if (r + reach < core || r - reach > stroke.radius_m) {
            const bool full = r < core;
            CHECK_NEAR(young, full ? 4 : 1, 1e-6);
            CHECK_NEAR(density, full ? 2 : 1, 1e-6);
            n_full += full, n_none += !full;
        } else {
            /* the stroke's weight changes by at most 1.5 over the soft band */
            const double w = pal_stroke_weight(&at_end, s.body->node_rest + 3 * (size_t)i), off = 1.5 * reach / band;
            CHECK(fabs(log(young) / log(4) - w) <= off && fabs(log(density) / log(2) - w) <= off);
            n_between++;
        }
    }
    CHECK(n_full > 0 && n_none > 0 && n_between > 0);
    tool_scene_close(&s);
    pal_cells_free(&cells);
}

/* The energies of a body, with its field energy: of a block in uniaxial tension that moves as a whole, E e^2 V / 2 and
 * m v^2 / 2 */
static void energies_are_those_of_a_stretched_block_that_moves(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"};
    const double strain = 0.02, speed = 0.5;
    for (int e = 0; e < 4; e++) {
        tool_scene s;
        double mass_kg = 0;
        REQUIRE(stretched(&s, element[e], "linear", strain, 0));
        for (int i = 0; i < s.body->n_dof; i++) {
            s.body->v[3 * i] = 0.6 * speed, s.body->v[3 * i + 1] = 0.8 * speed, s.body->v[3 * i + 2] = 0;
            mass_kg += s.body->mass_kg[i];
        }
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
        const pal_shown_field *shown = s.body->display.field[PAL_FIELD_ENERGY_J_M3];
        const pal_material *of = &s.scene->body[0].material;
        const double volume_m3 = mass_kg / of->density_kg_m3;
        CHECK_NEAR(volume_m3, 24e-6, 1e-12);
        CHECK_NEAR(shown->elastic_J / (0.5 * of->young_Pa * strain * strain * volume_m3), 1, 1e-5);
        CHECK_NEAR(shown->kinetic_J / (0.5 * mass_kg * speed * speed), 1, 1e-12);
        pal_frame *frame = pal_frame_create(s.world);
        REQUIRE(frame && !pal_frame_fit(frame, s.world));
        pal_world_frame(s.world, frame);
        CHECK_NEAR(frame->part[0].elastic_J, shown->elastic_J, 0);
        CHECK_NEAR(frame->part[0].kinetic_J, shown->kinetic_J, 0);
        pal_frame_destroy(frame);
        close_fem(&s);
    }
}

/* of springs: what the world's components give as energy, at rest 0 */
static void energies_of_springs_are_those_of_their_components(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15));
    s.scene->gravity_m_s2 = 0;
    REQUIRE(tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    CHECK_LE(s.body->display.field[PAL_FIELD_ENERGY_J_M3]->elastic_J, 1e-12);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, false, NULL));
    for (int i = 0; i < s.body->n_dof; i++) {
        const double *rest = s.body->x_rest + 3 * (size_t)i;
        for (int c = 0; c < 3; c++) s.body->x[3 * i + c] = rest[c] * (c == 0 ? 1.05 : 0.98);
        s.body->v[3 * i + 2] = 0.3;
    }
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    const pal_shown_field *shown = s.body->display.field[PAL_FIELD_ENERGY_J_M3];
    CHECK(shown->elastic_J > 1e-6 && shown->kinetic_J > 1e-6);
    CHECK_NEAR((shown->elastic_J + shown->kinetic_J) / pal_world_energy_J(s.world), 1, 1e-9);
    tool_scene_close(&s);
}

/* rest, collapsed, flat, turned over, sheared */
static void the_largest_strain_is_that_of_the_largest_stretch(void)
{
    const double rest[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, zero[9] = {0}, flat[9] = {1.5, 0, 0, 0, 0, 0, 0, 0, 1},
                 over[9] = {-1, 0, 0, 0, 2, 0, 0, 0, 1}, shear[9] = {1, 1, 0, 0, 1, 0, 0, 0, 1};
    CHECK_NEAR(pal_largest_strain(rest), 0, 0);
    CHECK_NEAR(pal_largest_strain(zero), -1, 1e-15);
    CHECK_NEAR(pal_largest_strain(flat), 0.5, 1e-8);
    CHECK_NEAR(pal_largest_strain(over), 1, 1e-8);
    /* simple shear by 1: the golden ratio */
    CHECK_NEAR(pal_largest_strain(shear), 0.5 * (sqrt(5) - 1), 1e-12);
}

int main(void)
{
    RUN(stress_and_energy_of_a_stretched_block_are_those_of_uniaxial_tension);
    RUN(strain_and_distortion_of_a_stretched_block_are_exact);
    RUN(strain_and_distortion_of_springs_are_those_of_their_tetrahedra);
    RUN(strain_and_distortion_of_a_solid_are_exact);
    RUN(density_is_that_of_the_regions);
    RUN(damping_is_the_rate_that_acts);
    RUN(energies_are_those_of_a_stretched_block_that_moves);
    RUN(energies_of_springs_are_those_of_their_components);
    RUN(painted_material_is_read_back);
    RUN(the_largest_strain_is_that_of_the_largest_stretch);
    return check_report();
}
