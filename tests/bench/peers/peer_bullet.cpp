// The reference beam in Bullet's deformable world (libbullet-dev), to be compared with `palpate bench fem` and `palpate
// solve`: error of the final shape against the reference, milliseconds per step of 1/60 s while it bends.
// Bullet's conjugate gradients stop at an absolute residual (in SI this beam does not move at all), so it gets the beam in
// centimetres, grams and seconds.
// usage: peer_bullet N_LONG NU FORCE_N REFERENCE.csv [SECONDS [SUBSTEPS]]
#include "tests/bench/peers/beam_lattice.h"

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <algorithm>
#include <chrono>
#include <vector>

// the tip load as one of Bullet's own forces
class tip_force : public btDeformableLagrangianForce
{
public:
    const beam *of;
    double newton;
    tip_force(const beam *b, double n) : of(b), newton(n) {}
    void addScaledForces(btScalar scale, TVStack &force) override { add(scale, force); }
    void addScaledExplicitForce(btScalar scale, TVStack &force) override { add(scale, force); }
    void addScaledDampingForce(btScalar, TVStack &) override {}
    void addScaledElasticForceDifferential(btScalar, const TVStack &, TVStack &) override {}
    void addScaledDampingForceDifferential(btScalar, const TVStack &, TVStack &) override {}
    void buildDampingForceDifferentialDiagonal(btScalar, TVStack &) override {}
    btDeformableLagrangianForceType getForceType() override { return BT_GRAVITY_FORCE; }

private:
    void add(btScalar scale, TVStack &force)
    {
        for (int i = 0; i < of->n_node; i++) force[i] += btVector3(0, 0, btScalar(-newton * of->load[i]) * scale);
    }
};

static const double CM = 100, GRAM = 1000, DYNE = CM * GRAM;

int main(int argc, char **argv)
{
    if (argc < 5) {
        fprintf(stderr, "usage: peer_bullet N_LONG NU FORCE_N REFERENCE.csv [SECONDS [SUBSTEPS]]\n");
        return 2;
    }
    int n_long = atoi(argv[1]), substeps = argc > 6 ? atoi(argv[6]) : 1;
    double nu = atof(argv[2]), force = atof(argv[3]), seconds = argc > 5 ? atof(argv[5]) : 8, young = 1e5 * GRAM / CM;
    beam b;
    beam_make(&b, n_long);

    btSoftBodyRigidBodyCollisionConfiguration config;
    btCollisionDispatcher dispatcher(&config);
    btDbvtBroadphase broadphase;
    btDeformableBodySolver solver;
    btDeformableMultiBodyConstraintSolver constraints;
    constraints.setDeformableSolver(&solver);
    btDeformableMultiBodyDynamicsWorld world(&dispatcher, &broadphase, &constraints, &config, &solver);
    world.setGravity(btVector3(0, 0, 0));
    world.getWorldInfo().m_gravity.setValue(0, 0, 0);
    world.getWorldInfo().m_maxDisplacement = 1000;

    std::vector<btVector3> x(b.n_node);
    for (int i = 0; i < b.n_node; i++) x[i].setValue(CM * b.x[3 * i], CM * b.x[3 * i + 1], CM * b.x[3 * i + 2]);
    std::vector<btScalar> mass(b.n_node, 0);
    for (int t = 0; t < b.n_tet; t++) {
        const int *c = b.tet + 4 * t;
        double volume = fabs((x[c[1]] - x[c[0]]).dot((x[c[2]] - x[c[0]]).cross(x[c[3]] - x[c[0]]))) / 6;
        for (int k = 0; k < 4; k++) mass[c[k]] += GRAM * 1000 * volume / 4 / (CM * CM * CM);
    }
    btSoftBody *body = new btSoftBody(&world.getWorldInfo(), b.n_node, x.data(), mass.data());
    for (int t = 0; t < b.n_tet; t++) body->appendTetra(b.tet[4 * t], b.tet[4 * t + 1], b.tet[4 * t + 2], b.tet[4 * t + 3]);
    body->initializeDmInverse();
    body->m_tetraScratches.resize(b.n_tet);
    body->m_tetraScratchesTn.resize(b.n_tet);
    body->m_cfg.kDP = 0;
    body->m_cfg.collisions = 0;
    body->m_sleepingThreshold = 0;
    body->m_maxSpeedSquared = 0;
    body->setActivationState(DISABLE_DEACTIVATION);
    for (int i = 0; i < b.n_node; i++)
        if (b.x[3 * i] < 1e-9) body->setMass(i, 0);
    world.addSoftBody(body);
    // the same damping as ours: 4 / s of mass-proportional drag, none of the stiffness kind
    btDeformableLinearElasticityForce elastic(young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu)), 4, 0);
    world.addForce(body, &elastic);
    tip_force load(&b, DYNE * force);
    world.addForce(body, &load);
    world.setImplicit(true);
    world.setLineSearch(false);
    world.setUseProjection(true);

    std::vector<double> ms;
    int n_step = (int)(seconds * 60);
    for (int s = 0; s < n_step; s++) {
        auto before = std::chrono::steady_clock::now();
        for (int k = 0; k < substeps; k++) world.stepSimulation(1.0 / 60 / substeps, 1, 1.0 / 60 / substeps);
        ms.push_back(1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count());
    }
    std::vector<double> u(3 * b.n_node);
    for (int i = 0; i < b.n_node; i++)
        for (int d = 0; d < 3; d++) u[3 * i + d] = body->m_nodes[i].m_x[d] / CM - b.x[3 * i + d];
    double tip = u[3 * beam_node(&b, b.n[0], b.n[1] / 2, b.n[2] / 2) + 2];
    std::sort(ms.begin(), ms.end());
    printf("{\"peer\": \"Bullet %d\", \"element\": \"tet4 corotational\", \"nodes\": %d, \"elements\": %d, \"nu\": %g, "
           "\"substeps\": %d, \"rms_percent\": %.3f, \"tip_z_m\": %.6f, \"ms_per_step_p50\": %.3f, \"ms_per_step_p95\": %.3f}\n",
           btGetVersion(), b.n_node, b.n_tet, nu, substeps, beam_error(&b, u.data(), argv[4]), tip, ms[ms.size() / 2],
           ms[ms.size() * 95 / 100]);
    return 0;
}
