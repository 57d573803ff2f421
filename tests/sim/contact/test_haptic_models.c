/* exploration */
#include "server/base/vec3.h"
#include "tests/fixtures/model_scenes.h"

static void pose(model_scene *m, const double x[3], bool grasp)
{
    pal_pose p = {.quat = {1, 0, 0, 0}, .buttons = grasp};
    pal_copy3(p.position_m, x);
    REQUIRE(!pal_world_pose(m->world, 0, &p));
}
static const pal_tool *tool_of(const model_scene *m) { return &pal_world_tools(m->world)->tool[0]; }

static void go(model_scene *m, double at[3], const double to[3], double speed, int settle, bool grasp)
{
    double step = speed * m->scene->step_s, far = pal_dist3(at, to);
    int n = (int)ceil(far / step);
    double from[3];
    pal_copy3(from, at);
    for (int i = 1; i <= n; i++) {
        for (int c = 0; c < 3; c++) at[c] = from[c] + (to[c] - from[c]) * i / n;
        pose(m, at, grasp);
        REQUIRE(model_scene_steps(m, 1));
    }
    REQUIRE(model_scene_steps(m, settle));
}
static bool begin(model_scene *m, model_kind kind, double mu, double at[3])
{
    model_scene_make(m, kind);
    m->scene->tool[0].force_cap_N = 15;
    pal_tools_default(m->scene, 1);
    const bool box = kind == SPRINGS || kind == FEM;
    if (box) {
        box_free(&m->mesh);
        if (box_make(8, 8, 4, 0.01, &m->mesh)) abort();
        if (kind == FEM) { pal_hexes_free(&m->mesh.hexes); if (pal_hexes_find(&m->mesh.tets, &m->mesh.hexes, &m->diag)) abort(); }
    }
    m->scene->tool[0].radius_m = 0.012;
    pal_config_entry *push = model_scene_effect(m, "tool_push");
    model_scene_effect(m, "tool_grasp");
    model_scene_effect(m, "finite_guard");
    if (mu > 0) pal_entry_put_number(push, "friction", mu, NULL);
    if (!model_scene_open(m)) return false;
    at[0] = box ? 0.037 : 0.004, at[1] = box ? 0.042 : 0.003, at[2] = box ? 0.055 : 0.055;
    pose(m, at, false);
    double to[3];
    pal_copy3(to, at);
    while (!tool_of(m)->touching) { to[2] = at[2] - 0.0001; go(m, at, to, 0.03, 0, false); }
    go(m, at, to, 0.02, 60, false);
    return true;
}

static void rest(model_scene *m, double at[3], double tremor, int n, double *dk, double *dp, double *kmean, double *kmin, double *kmax, double *fdiff, double *npatch)
{
    pal_contact_patch last = {0};
    double k0 = 0;
    *dk = *dp = *kmean = *fdiff = 0; *kmin = INFINITY; *kmax = 0; *npatch = 0;
    for (int i = 0; i < n; i++) {
        double x[3];
        pal_copy3(x, at);
        double t = i * m->scene->step_s;
        x[2] += tremor * sin(2 * M_PI * 8 * t), x[0] += tremor * sin(2 * M_PI * 7 * t);
        pose(m, x, false);
        REQUIRE(model_scene_steps(m, 1));
        const pal_tool *tool = tool_of(m);
        *npatch = fmax(*npatch, tool->n_patch);
        const pal_contact_patch *p = &tool->patch[0];
        double d = pal_dot3(p->normal, (double[3]){p->point_m[0]-tool->here_m[0],p->point_m[1]-tool->here_m[1],p->point_m[2]-tool->here_m[2]});
        *fdiff = fmax(*fdiff, fabs(p->k1_N_m * d / pal_norm3(tool->force_N) - 1));
        if (i) {
            double move[3];
            pal_sub3(move, p->point_m, last.point_m);
            *dk = fmax(*dk, fabs(p->k1_N_m / last.k1_N_m - 1));
            *dp = fmax(*dp, fabs(pal_dot3(move, p->normal)));
        }
        last = *p, k0 = p->k1_N_m;
        *kmean += k0 / n; *kmin = fmin(*kmin, k0), *kmax = fmax(*kmax, k0);
    }
}

static void press(void)
{
    for (int kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3], top;
        REQUIRE(begin(&m, kind, 0, at));
        printf("%s substeps %d compliance %d implicit %d S %.3g\n", model_kind_name[kind], pal_world_substeps(m.world), m.body->compliance != NULL, m.body->implicit, m.body->length_scale_m);
        top = at[2];
        for (int k = 1; k <= 3; k++) {
            double to[3] = {at[0], at[1], top - 0.002 * k}, dk, dp, km, k0, k1, fd, np;
            go(&m, at, to, 0.02, 0, false);
            rest(&m, at, 0, 60, &dk, &dp, &km, &k0, &k1, &fd, &np);
            printf("  %d mm arriving: dk %.3g dp %.3g mm k %.4g..%.4g F/kd-1 %.2g patches %g\n", 2*k, dk, 1e3*dp, k0, k1, fd, np);
            go(&m, at, to, 0.02, 120, false);
            rest(&m, at, 0, 60, &dk, &dp, &km, &k0, &k1, &fd, &np);
            double F = pal_norm3(tool_of(&m)->mean_force_N), kk = km;
            printf("  rest: F %.4g dk %.3g dp %.3g mm k %.4g..%.4g F/kd-1 %.2g\n", F, dk, 1e3*dp, k0, k1, fd);
            rest(&m, at, 0.00005, 120, &dk, &dp, &km, &k0, &k1, &fd, &np);
            printf("  tremor: dk %.3g dp %.3g mm k %.4g..%.4g F/kd-1 %.2g\n", dk, 1e3*dp, k0, k1, fd);
            double d = 0.0005, n[3];
            double hi[3] = {at[0], at[1], at[2] + d}, lo[3] = {at[0], at[1], at[2] - d}, mid[3];
            pal_copy3(mid, at);
            pal_copy3(n, tool_of(&m)->patch[0].normal);
            go(&m, at, hi, 0.02, 150, false);
            double fh = tool_of(&m)->mean_force_N[2];
            go(&m, at, lo, 0.02, 150, false);
            double fl = tool_of(&m)->mean_force_N[2];
            go(&m, at, mid, 0.02, 150, false);
            double f0 = tool_of(&m)->mean_force_N[2];
            printf("  slope %.4g (%.4g %.4g)  k1 %.4g n_z %.4g  k1 nz^2 %.4g\n", (fl - fh) / (2 * d), (f0 - fh)/d, (fl-f0)/d, kk, n[2], kk * n[2] * n[2]);
        }
        model_scene_close(&m);
    }
}
static void grip(void)
{
    for (int kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3];
        REQUIRE(begin(&m, kind, 0, at));
        double to[3] = {at[0], at[1], at[2] + 0.001};
        go(&m, at, to, 0.02, 60, false);
        go(&m, at, to, 0.02, 10, false);
        pose(&m, at, true);
        REQUIRE(model_scene_steps(&m, 10));
        to[2] += 0.005;
        go(&m, at, to, 0.02, 150, true);
        const pal_tool *t = tool_of(&m);
        CHECK(t->has_grasp);
        double K[6], f0[3];
        memcpy(K, t->grasp_k_N_m, sizeof K);
        pal_copy3(f0, t->mean_force_N);
        printf("%s f0 %.4g %.4g %.4g K %.4g %.4g %.4g %.4g %.4g %.4g b %.3g\n", model_kind_name[kind], f0[0], f0[1], f0[2], K[0],K[1],K[2],K[3],K[4],K[5], t->grasp_b_Ns_m);
        double base[3], S[3][3];
        pal_copy3(base, at);
        for (int c = 0; c < 3; c++) {
            double f[2][3];
            for (int s = 0; s < 2; s++) {
                double p[3];
                pal_copy3(p, base);
                p[c] += s ? 0.001 : -0.001;
                go(&m, at, p, 0.02, 150, true);
                pal_copy3(f[s], tool_of(&m)->mean_force_N);
            }
            for (int i = 0; i < 3; i++) S[i][c] = -(f[1][i] - f[0][i]) / 0.002;
        }
        printf("  FD %.4g %.4g %.4g / %.4g %.4g %.4g / %.4g %.4g %.4g\n", S[0][0],S[0][1],S[0][2],S[1][0],S[1][1],S[1][2],S[2][0],S[2][1],S[2][2]);
        go(&m, at, base, 0.02, 150, true);
        t = tool_of(&m);
        memcpy(K, t->grasp_k_N_m, sizeof K);
        printf("  after: K %.4g %.4g %.4g %.4g %.4g %.4g\n", K[0],K[1],K[2],K[3],K[4],K[5]);
        model_scene_close(&m);
    }
}
static void drag(void)
{
    for (int kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3];
        REQUIRE(begin(&m, kind, 0.4, at));
        double to[3] = {at[0] , at[1], at[2] - 0.003};
        go(&m, at, to, 0.02, 100, false);
        const pal_tool *t = tool_of(&m);
        printf("%s kt %.4g k1 %.4g mu %.3g %.3g\n", model_kind_name[kind], t->patch[0].kt_N_m, t->patch[0].k1_N_m, t->patch[0].mu_static, t->patch[0].mu_dynamic);
        for (int i = 0; i < 12; i++) {
            to[0] += 0.001;
            go(&m, at, to, 0.02, 20, false);
            t = tool_of(&m);
            const double *n = t->patch[0].normal, *f = t->mean_force_N;
            double N = pal_dot3(f, n), T[3];
            pal_copy3(T, f); pal_axpy3(T, -N, n);
            printf("   %.3g mm: N %.4g T %.4g T/N %.3g fx %.4g k1 %.4g kt %.4g n %.3g %.3g %.3g np %d\n", 0.5*(i+1), N, pal_norm3(T), pal_norm3(T)/N, f[0], t->patch[0].k1_N_m, t->patch[0].kt_N_m, n[0], n[1], n[2], t->n_patch);
        }
        model_scene_close(&m);
    }
}
int main(int argc, char **argv)
{
    if (argc < 2 || argv[1][0] == 'p') press();
    if (argc < 2 || argv[1][0] == 'g') grip();
    if (argc < 2 || argv[1][0] == 'd') drag();
    return 0;
}
