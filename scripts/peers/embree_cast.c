/* Raw Embree beside open3d_cast.py: casts the same rays at the same mesh by rtcIntersect8, on request.
 *
 * embree_cast DIR YARD robust|default   builds the scene of DIR/YARD.vertices.f64 and DIR/YARD.triangles.i32, prints the CPU seconds
 * that took, then reads lines `SWEEP REACH_M` and answers each with the CPU seconds of casting DIR/YARD.SWEEP.rays.f64 in packets of
 * eight; the ranges (infinite where nothing was met) go to DIR/YARD.SWEEP.MODE.f32. One thread. Rays come as Embree likes them: float,
 * one array a component, marked coherent, and cut off at the reach. Timed: filling the packets, rtcIntersect8, ranges and ids out.
 */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void *read_all(const char *dir, const char *name, size_t *bytes) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *file = fopen(path, "rb");
    if (!file) {
        fprintf(stderr, "%s: cannot be read\n", path);
        exit(1);
    }
    fseek(file, 0, SEEK_END);
    *bytes = (size_t)ftell(file);
    rewind(file);
    void *data = malloc(*bytes);
    if (!data || fread(data, 1, *bytes, file) != *bytes) {
        fprintf(stderr, "%s: ends early\n", path);
        exit(1);
    }
    fclose(file);
    return data;
}

static RTCScene build(RTCDevice device, const char *dir, const char *yard, int robust) {
    char name[512];
    size_t bytes;
    snprintf(name, sizeof name, "%s.vertices.f64", yard);
    double *from = read_all(dir, name, &bytes);
    size_t vertices = bytes / (3 * sizeof(double));
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *to = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices);
    for (size_t k = 0; k < 3 * vertices; k++) to[k] = (float)from[k];
    free(from);
    snprintf(name, sizeof name, "%s.triangles.i32", yard);
    unsigned *corners = read_all(dir, name, &bytes);
    size_t triangles = bytes / (3 * sizeof(unsigned));
    unsigned *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangles);
    memcpy(index, corners, bytes);
    free(corners);

    double begun = cpu_s();
    rtcCommitGeometry(geometry);
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    printf("%.6f\n", cpu_s() - begun);
    fflush(stdout);
    return scene;
}

/* Rays of one sweep as arrays of components, padded to whole packets. */
struct Sweep {
    char name[64];
    size_t count;
    float *component[6];
    float *range;
    unsigned *primitive;
};

static struct Sweep load(const char *dir, const char *yard, const char *name) {
    struct Sweep sweep = {0};
    char file[512];
    size_t bytes;
    snprintf(sweep.name, sizeof sweep.name, "%s", name);
    snprintf(file, sizeof file, "%s.%s.rays.f64", yard, name);
    double *rays = read_all(dir, file, &bytes);
    sweep.count = bytes / (6 * sizeof(double));
    size_t padded = (sweep.count + 7) / 8 * 8;
    for (int c = 0; c < 6; c++) {
        sweep.component[c] = aligned_alloc(64, (padded * sizeof(float) + 63) / 64 * 64);
        for (size_t k = 0; k < padded; k++)
            sweep.component[c][k] = (float)rays[6 * (k < sweep.count ? k : sweep.count - 1) + c];
    }
    sweep.range = malloc(padded * sizeof(float));
    sweep.primitive = malloc(padded * sizeof(unsigned));
    free(rays);
    return sweep;
}

static double cast(RTCScene scene, struct Sweep *sweep, float reach) {
    static const int valid[8] __attribute__((aligned(32))) = {-1, -1, -1, -1, -1, -1, -1, -1};
    double begun = cpu_s();
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    for (size_t first = 0; first < sweep->count; first += 8) {
        struct RTCRayHit8 packet;
        memcpy(packet.ray.org_x, sweep->component[0] + first, sizeof packet.ray.org_x);
        memcpy(packet.ray.org_y, sweep->component[1] + first, sizeof packet.ray.org_y);
        memcpy(packet.ray.org_z, sweep->component[2] + first, sizeof packet.ray.org_z);
        memcpy(packet.ray.dir_x, sweep->component[3] + first, sizeof packet.ray.dir_x);
        memcpy(packet.ray.dir_y, sweep->component[4] + first, sizeof packet.ray.dir_y);
        memcpy(packet.ray.dir_z, sweep->component[5] + first, sizeof packet.ray.dir_z);
        for (int l = 0; l < 8; l++) {
            packet.ray.tnear[l] = 0.0f;
            packet.ray.tfar[l] = reach;
            packet.ray.time[l] = 0.0f;
            packet.ray.mask[l] = ~0u;
            packet.ray.id[l] = 0;
            packet.ray.flags[l] = 0;
            packet.hit.geomID[l] = RTC_INVALID_GEOMETRY_ID;
            packet.hit.instID[0][l] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, scene, &context, &packet);
        for (int l = 0; l < 8; l++) {
            int met = packet.hit.geomID[l] != RTC_INVALID_GEOMETRY_ID;
            sweep->range[first + l] = met ? packet.ray.tfar[l] : INFINITY;
            sweep->primitive[first + l] = met ? packet.hit.primID[l] : ~0u;
        }
    }
    return cpu_s() - begun;
}

int main(int count, char **words) {
    if (count != 4) {
        fprintf(stderr, "usage: embree_cast DIR YARD robust|default\n");
        return 2;
    }
    RTCDevice device = rtcNewDevice("threads=1,set_affinity=0");
    RTCScene scene = build(device, words[1], words[2], strcmp(words[3], "robust") == 0);
    struct Sweep sweeps[8];
    int known = 0;
    char line[256], name[64];
    float reach;
    while (fgets(line, sizeof line, stdin) && sscanf(line, "%63s %f", name, &reach) == 2) {
        int at = 0;
        while (at < known && strcmp(sweeps[at].name, name) != 0) at++;
        int fresh = at == known;
        if (fresh) {
            if (known == 8) return 1;
            sweeps[known++] = load(words[1], words[2], name);
        }
        double seconds = cast(scene, &sweeps[at], reach);
        if (fresh) {
            char path[4096];
            snprintf(path, sizeof path, "%s/%s.%s.%s.f32", words[1], words[2], name, words[3]);
            FILE *file = fopen(path, "wb");
            if (!file || fwrite(sweeps[at].range, sizeof(float), sweeps[at].count, file) != sweeps[at].count) return 1;
            fclose(file);
        }
        printf("%.9f\n", seconds);
        fflush(stdout);
    }
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return 0;
}
