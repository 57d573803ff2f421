/* The reference beam in CalculiX (calculix-ccx): writes the input, runs it, reads the displacements and prints error
 * and time of the whole run. Elements C3D8 (full), C3D8I (incompatible modes), C3D4. usage: peer_calculix N_LONG NU
 * FORCE_N linear|finite REFERENCE.csv ELEMENT FOLDER */
#include "tests/bench/peers/beam_lattice.h"

#include <string.h>
#include <time.h>
#include <unistd.h>

/* our corners x = 1, y = 2, z = 4 in the order of C3D8 */
static const int hex_order[8] = {0, 1, 3, 2, 4, 5, 7, 6};

static void write_input(const beam *b, const char *path, const char *element, double nu, double force, int finite)
{
    FILE *to = fopen(path, "w");
    int tet = !strcmp(element, "C3D4");
    if (!to) {
        perror(path);
        exit(1);
    }
    fprintf(to, "*NODE, NSET=ALL\n");
    for (int i = 0; i < b->n_node; i++)
        fprintf(to, "%d, %.10g, %.10g, %.10g\n", i + 1, b->x[3 * i], b->x[3 * i + 1], b->x[3 * i + 2]);
    fprintf(to, "*ELEMENT, TYPE=%s, ELSET=BODY\n", element);
    int n = tet ? b->n_tet : b->n_cube, corners = tet ? 4 : 8;
    for (int e = 0; e < n; e++) {
        fprintf(to, "%d", e + 1);
        for (int k = 0; k < corners; k++)
            fprintf(to, ", %d", 1 + (tet ? b->tet[4 * e + k] : b->cube[8 * e + hex_order[k]]));
        fprintf(to, "\n");
    }
    fprintf(to, "*NSET, NSET=CLAMP\n");
    for (int i = 0; i < b->n_node; i++)
        if (b->x[3 * i] < 1e-9) fprintf(to, "%d\n", i + 1);
    if (finite) { /* the reference's law: W = mu/2 (I - 3) + (J - 1)^2 / D1 */
        double c10 = 1e5 / (4 * (1 + nu)), d1 = 6 * (1 - 2 * nu) / 1e5;
        fprintf(to, "*MATERIAL, NAME=M\n*HYPERELASTIC, NEO HOOKE\n%.10g, %.10g\n", c10, d1);
    } else {
        fprintf(to, "*MATERIAL, NAME=M\n*ELASTIC\n1e5, %.10g\n", nu);
    }
    fprintf(to, "*SOLID SECTION, ELSET=BODY, MATERIAL=M\n*BOUNDARY\nCLAMP, 1, 3\n");
    fprintf(to, finite ? "*STEP, NLGEOM, INC=200\n*STATIC\n0.1, 1., 1e-4, 0.25\n" : "*STEP\n*STATIC\n");
    fprintf(to, "*CLOAD\n");
    for (int i = 0; i < b->n_node; i++)
        if (b->load[i] > 0) fprintf(to, "%d, 3, %.10g\n", i + 1, -force * b->load[i]);
    fprintf(to, "*NODE PRINT, NSET=ALL, FREQUENCY=999\nU\n*END STEP\n");
    fclose(to);
}

/* the last block of displacements in the .dat file */
static int read_output(const beam *b, const char *path, double *u)
{
    FILE *from = fopen(path, "r");
    char line[256];
    int node, n = 0;
    double d[3];
    if (!from) return 0;
    while (fgets(line, sizeof line, from)) {
        if (strstr(line, "displacements")) n = 0;
        if (sscanf(line, "%d %lf %lf %lf", &node, d, d + 1, d + 2) != 4 || node < 1 || node > b->n_node) continue;
        memcpy(u + 3 * (node - 1), d, sizeof d);
        n++;
    }
    fclose(from);
    return n == b->n_node;
}

int main(int argc, char **argv)
{
    if (argc != 8) {
        fprintf(stderr, "usage: peer_calculix N_LONG NU FORCE_N linear|finite REFERENCE.csv ELEMENT FOLDER\n");
        return 2;
    }
    beam b;
    struct timespec t0, t1;
    char path[512], command[600];
    beam_make(&b, atoi(argv[1]));
    double nu = atof(argv[2]), *u = calloc((size_t)b.n_node * 3, sizeof(double));
    snprintf(path, sizeof path, "%s/beam.inp", argv[7]);
    write_input(&b, path, argv[6], nu, atof(argv[3]), !strcmp(argv[4], "finite"));
    snprintf(command, sizeof command, "cd '%s' && OMP_NUM_THREADS=1 ccx beam >ccx.log 2>&1", argv[7]);
    clock_gettime(CLOCK_MONOTONIC, &t0);
    int code = system(command);
    clock_gettime(CLOCK_MONOTONIC, &t1);
    snprintf(path, sizeof path, "%s/beam.dat", argv[7]);
    if (code != 0 || !read_output(&b, path, u)) {
        fprintf(stderr, "peer_calculix: ccx gave no displacements, see %s/ccx.log\n", argv[7]);
        return 1;
    }
    double ms = 1e3 * (double)(t1.tv_sec - t0.tv_sec) + 1e-6 * (double)(t1.tv_nsec - t0.tv_nsec);
    printf("{\"peer\": \"CalculiX\", \"element\": \"%s %s\", \"nodes\": %d, \"nu\": %g, \"rms_percent\": %.3f, "
           "\"tip_z_m\": "
           "%.6f, \"ms\": %.0f}\n",
           argv[6], argv[4], b.n_node, nu, beam_error(&b, u, argv[5]),
           u[3 * beam_node(&b, b.n[0], b.n[1] / 2, b.n[2] / 2) + 2], ms);
    return 0;
}
