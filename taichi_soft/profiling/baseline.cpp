// Substeps of the virial law, of springs and of volume springs with edge damping, in plain C++. The code uses one
// thread, arrays of structures and no intrinsics. `taichi-soft profile --baseline` compares Taichi with it.

#include <cmath>

struct Vec {
    float x, y, z;
};
static inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
static inline float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static void add_elastic_forces(int tet_count, const Vec *x, const int *vertices, const float *rest_inverse,
                               const float *lame, Vec *force) {
    for (int t = 0; t < tet_count; t++) {
        const int *i = vertices + 4 * t;
        const float *a = rest_inverse + 9 * t;  // row-major
        const float lambda = lame[2 * t], mu = lame[2 * t + 1];
        const Vec b0 = x[i[1]] - x[i[0]], b1 = x[i[2]] - x[i[0]], b2 = x[i[3]] - x[i[0]];
        const Vec f0 = a[0] * b0 + a[3] * b1 + a[6] * b2;
        const Vec f1 = a[1] * b0 + a[4] * b1 + a[7] * b2;
        const Vec f2 = a[2] * b0 + a[5] * b1 + a[8] * b2;
        const float exx = 0.5f * (f0.x * f0.x + f1.x * f1.x + f2.x * f2.x - 1.0f);
        const float eyy = 0.5f * (f0.y * f0.y + f1.y * f1.y + f2.y * f2.y - 1.0f);
        const float ezz = 0.5f * (f0.z * f0.z + f1.z * f1.z + f2.z * f2.z - 1.0f);
        const float exy = 0.5f * (f0.x * f0.y + f1.x * f1.y + f2.x * f2.y);
        const float exz = 0.5f * (f0.x * f0.z + f1.x * f1.z + f2.x * f2.z);
        const float eyz = 0.5f * (f0.y * f0.z + f1.y * f1.z + f2.y * f2.z);
        const Vec n0 = cross(b1, b2), n1 = cross(b2, b0), n2 = cross(b0, b1);
        const float side = (dot(b0, n0) < 0.0f ? -1.0f : 1.0f) / 6.0f;
        const float pressure = lambda * (exx + eyy + ezz);
        const float sxx = side * (pressure + 2 * mu * exx), sxy = side * 2 * mu * exy;
        const float syy = side * (pressure + 2 * mu * eyy), sxz = side * 2 * mu * exz;
        const float szz = side * (pressure + 2 * mu * ezz), syz = side * 2 * mu * eyz;
        auto on = [&](Vec n) {
            return Vec{sxx * n.x + sxy * n.y + sxz * n.z, sxy * n.x + syy * n.y + syz * n.z,
                       sxz * n.x + syz * n.y + szz * n.z};
        };
        const Vec g0 = on(n0), g1 = on(n1), g2 = on(n2);
        force[i[0]] = force[i[0]] + (g0 + g1 + g2);
        force[i[1]] = force[i[1]] - g0;
        force[i[2]] = force[i[2]] - g1;
        force[i[3]] = force[i[3]] - g2;
    }
}

static void add_edge_damping(int edge_count, const Vec *x, const Vec *v, const int *ends, const float *damping,
                             Vec *force) {
    for (int e = 0; e < edge_count; e++) {
        const int p = ends[2 * e], q = ends[2 * e + 1];
        const Vec r = x[q] - x[p];
        const Vec along = (damping[e] * dot(r, v[q] - v[p]) / dot(r, r)) * r;
        force[p] = force[p] + along;
        force[q] = force[q] - along;
    }
}

static void move(int particle_count, Vec *x, Vec *v, Vec *force, const float *inv_mass, float h, float gravity,
                 float floor) {
    for (int p = 0; p < particle_count; p++) {
        v[p] = v[p] + (h * inv_mass[p]) * force[p];
        v[p].z += h * gravity;
        x[p] = x[p] + h * v[p];
        if (x[p].z < floor) {
            x[p].z = floor;
            if (v[p].z < 0.0f) v[p].z = 0.0f;
        }
        force[p] = {0.0f, 0.0f, 0.0f};
    }
}

// Thesis eq. 5.4: the volume change of each tetrahedron pulls its six edges together.
static void add_volume_pressure(int tet_count, const Vec *x, const int *vertices, const float *inv_volume6,
                                const float *modulus, const int *edges, float *pressure) {
    for (int t = 0; t < tet_count; t++) {
        const int *i = vertices + 4 * t;
        const Vec b0 = x[i[1]] - x[i[0]], b1 = x[i[2]] - x[i[0]], b2 = x[i[3]] - x[i[0]];
        const float volume6 = dot(b0, cross(b1, b2));
        const float push = modulus[t] * ((volume6 < 0.0f ? -volume6 : volume6) * inv_volume6[t] - 1.0f);
        for (int k = 0; k < 6; k++) pressure[edges[6 * t + k]] += push;
    }
}

static void add_spring_forces(int edge_count, const Vec *x, const Vec *v, const int *ends, const float *length,
                              const float *stiffness, const float *area, const float *damping, float *pressure,
                              Vec *force) {
    for (int e = 0; e < edge_count; e++) {
        const int p = ends[2 * e], q = ends[2 * e + 1];
        const Vec r = x[q] - x[p];
        const float square = dot(r, r), now = std::sqrt(square);
        const float pull = stiffness[e] * (now - length[e]) + area[e] * pressure[e];
        const Vec along = (pull / now + damping[e] * dot(r, v[q] - v[p]) / square) * r;
        pressure[e] = 0.0f;
        force[p] = force[p] + along;
        force[q] = force[q] - along;
    }
}

#ifdef _WIN32
#define EXPORT extern "C" __declspec(dllexport)
#else
#define EXPORT extern "C"
#endif

EXPORT void run_spring_substeps(int particle_count, int tet_count, int edge_count, float *x, float *v, float *force,
                                const float *inv_mass, const int *vertices, const float *inv_volume6,
                                const float *modulus, const int *edges, const int *ends, const float *length,
                                const float *stiffness, const float *area, const float *damping, float *pressure,
                                float h, float gravity, float floor, int substeps) {
    Vec *positions = reinterpret_cast<Vec *>(x);
    Vec *velocities = reinterpret_cast<Vec *>(v);
    Vec *forces = reinterpret_cast<Vec *>(force);
    for (int s = 0; s < substeps; s++) {
        add_volume_pressure(tet_count, positions, vertices, inv_volume6, modulus, edges, pressure);
        add_spring_forces(edge_count, positions, velocities, ends, length, stiffness, area, damping, pressure, forces);
        move(particle_count, positions, velocities, forces, inv_mass, h, gravity, floor);
    }
}

EXPORT void run_substeps(int particle_count, int tet_count, int edge_count, float *x, float *v, float *force,
                             const float *inv_mass, const int *vertices, const float *rest_inverse,
                             const float *lame, const int *ends, const float *damping, float h, float gravity,
                             float floor, int substeps) {
    Vec *positions = reinterpret_cast<Vec *>(x);
    Vec *velocities = reinterpret_cast<Vec *>(v);
    Vec *forces = reinterpret_cast<Vec *>(force);
    for (int s = 0; s < substeps; s++) {
        add_elastic_forces(tet_count, positions, vertices, rest_inverse, lame, forces);
        add_edge_damping(edge_count, positions, velocities, ends, damping, forces);
        move(particle_count, positions, velocities, forces, inv_mass, h, gravity, floor);
    }
}
