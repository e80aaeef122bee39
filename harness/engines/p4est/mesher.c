/* An oct-tree mesher on p4est: refinement by distance from the facets, then p8est_balance.
 *
 *   p4est-mesher CASE [--out FOREST] [--json FILE]        or with mpirun -n RANKS
 *
 * Reads a case file with a geometry file, a [root] table and keep = "all", as the harness writes it for an engine with
 * `generator = false`. An octant of level l is split if a facet meets its box enlarged on every side by reach[l]:
 *
 *   reach[D - 1] = (n - 1) cells of level D,     reach[l - 1] = reach[l] + n cells of level l.
 *
 * These are the least distances that promise layers of n cells, because every octant within reach of a facet is split
 * whatever the other octants do. FOREST is the file of p8est_save; FILE receives the run report.
 *
 * Exit codes: 0 success, 1 p4est could not write FOREST, 2 the case cannot be read or is not supported, 4 FILE could not be written.
 */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <sys/resource.h>
#include <time.h>

#include <p8est_bits.h>
#include <p8est_extended.h>

#include "facets.h"

const char *const program_name = "p4est-mesher";

/* One unit of p4est, at level 19, in units. */
#define QUADRANT_UNITS 256

/* A case file, as far as this program supports it. */
struct job {
    char geometry[4096];
    double spacing, origin[3], edge;
    int layers;
};

static struct job read_case(const char *path)
{
    struct job job = {.layers = 4};
    char line[8192], name[4096] = "", keep[16] = "outside";
    FILE *file = fopen(path, "r");
    if (file == NULL)
        fail(EXIT_INPUT, "%s cannot be opened", path);
    while (fgets(line, sizeof line, file) != NULL) {
        sscanf(line, "geometry = \"%4095[^\"]", name);
        sscanf(line, "keep = \"%15[^\"]", keep);
        sscanf(line, "spacing_min = %lf", &job.spacing);
        sscanf(line, "layer_cells_min = %d", &job.layers);
        sscanf(line, "origin = [%lf , %lf , %lf", &job.origin[0], &job.origin[1], &job.origin[2]);
        sscanf(line, "edge = %lf", &job.edge);
        if (strncmp(line, "[[box]]", 7) == 0)
            fail(EXIT_INPUT, "%s has a box, which is not supported", path);
    }
    fclose(file);
    if (strcmp(keep, "all") != 0)
        fail(EXIT_INPUT, "%s has keep = \"%s\", but only \"all\" is supported", path, keep);
    if (name[0] == '\0' || !(job.spacing > 0) || !(job.edge > 0) || job.layers < 1)
        fail(EXIT_INPUT, "%s lacks a geometry, a spacing or a [root] table", path);
    const char *slash = strrchr(path, '/');
    int directory = name[0] == '/' || slash == NULL ? 0 : (int) (slash - path) + 1;
    if (snprintf(job.geometry, sizeof job.geometry, "%.*s%s", directory, path, name) >= (int) sizeof job.geometry)
        fail(EXIT_INPUT, "the path of %s is too long", name);
    return job;
}

/* Where to refine. */
struct search {
    struct tree tree;
    double reach[P8EST_MAXLEVEL + 1];
    int level_surface, level_limit;
    double time_s;
};

static struct search new_search(const struct job *job)
{
    struct search s = {.tree = tree_of(read_stl(job->geometry), job->origin, job->edge)};
    while (ldexp(job->edge, -s.level_surface) > job->spacing)
        ++s.level_surface;
    if (s.level_surface > P8EST_QMAXLEVEL)
        fail(EXIT_INPUT, "the spacing needs level %d, and the deepest level of p4est is %d", s.level_surface,
             P8EST_QMAXLEVEL);
    double reach = (job->layers - 1) * ldexp(UNITS, -s.level_surface);
    for (int level = s.level_surface - 1; level >= 0; --level) {
        s.reach[level] = reach;
        reach += job->layers * ldexp(UNITS, -level);
    }
    return s;
}

static double clock_s(clockid_t clock)
{
    struct timespec time;
    clock_gettime(clock, &time);
    return (double) time.tv_sec + 1e-9 * (double) time.tv_nsec;
}

static int must_split(p8est_t *forest, p4est_topidx_t tree, p8est_quadrant_t *octant)
{
    (void) tree;
    struct search *s = forest->user_pointer;
    if (octant->level >= s->level_limit)
        return 0;
    double start = clock_s(CLOCK_MONOTONIC);
    double half = ldexp(UNITS, -octant->level - 1);
    double centre[3] = {(double) octant->x * QUADRANT_UNITS + half, (double) octant->y * QUADRANT_UNITS + half,
                        (double) octant->z * QUADRANT_UNITS + half};
    bool split = any_meets(&s->tree, 0, 0, s->tree.facets.count, centre, half + s->reach[octant->level]);
    s->time_s += clock_s(CLOCK_MONOTONIC) - start;
    return split;
}

/* CPU times of phases, in seconds. */
enum { READ, SEARCH, REFINE, BALANCE, PARTITION, PHASES };
static const char *const phase_names[PHASES] = {"read", "search", "refine", "balance", "partition"};

/* Refines some levels at a time, so that partitions of a few levels share the work of the next. */
static void refine(p8est_t *forest, double cpu_s[PHASES])
{
    struct search *s = forest->user_pointer;
    for (s->level_limit = 0; s->level_limit < s->level_surface;) {
        s->level_limit = forest->mpisize == 1 ? s->level_surface : SC_MIN(s->level_limit + 4, s->level_surface);
        double cpu = clock_s(CLOCK_PROCESS_CPUTIME_ID), wall = clock_s(CLOCK_MONOTONIC);
        s->time_s = 0;
        p8est_refine(forest, 1, must_split, NULL);
        cpu = clock_s(CLOCK_PROCESS_CPUTIME_ID) - cpu;
        /* The clock of the process takes a system call, so its time is divided as the wall time is. */
        double search = cpu * SC_MIN(1, s->time_s / (clock_s(CLOCK_MONOTONIC) - wall));
        cpu_s[SEARCH] += search;
        cpu_s[REFINE] += cpu - search;
        cpu = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        p8est_partition(forest, 0, NULL);
        cpu_s[PARTITION] += clock_s(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    }
}

static void balance(p8est_t *forest, double cpu_s[PHASES])
{
    double start = clock_s(CLOCK_PROCESS_CPUTIME_ID);
    p8est_balance(forest, P8EST_CONNECT_FULL, NULL);
    double balanced = clock_s(CLOCK_PROCESS_CPUTIME_ID);
    p8est_partition(forest, 0, NULL);
    cpu_s[BALANCE] = balanced - start;
    cpu_s[PARTITION] += clock_s(CLOCK_PROCESS_CPUTIME_ID) - balanced;
}

/* What every rank reports. */
struct figures {
    double cpu_s[PHASES], time_wall_s;
    uint64_t peak_rss_bytes;
};

static void write_json(const char *path, const struct figures *ranks, int count, const p8est_t *forest, size_t facets)
{
    FILE *file = fopen(path, "w");
    if (file == NULL)
        fail(EXIT_WRITE, "%s cannot be written", path);
    double time_s = 0;
    for (int rank = 0; rank < count; ++rank)
        time_s = fmax(time_s, ranks[rank].time_wall_s);
    fprintf(file, "{\"cells\": %" PRId64 ", \"ranks\": %d, \"facets\": %zu", (int64_t) forest->global_num_quadrants, count, facets);
    fprintf(file, ", \"time_wall_s\": %.6f, \"peak_rss_bytes\": [", time_s);
    for (int rank = 0; rank < count; ++rank)
        fprintf(file, "%s%" PRIu64, rank ? ", " : "", ranks[rank].peak_rss_bytes);
    for (int phase = 0; phase < PHASES; ++phase) {
        fprintf(file, "%s{\"name\": \"%s\", \"time_cpu_s\": [", phase ? "]}, " : "], \"phases\": [", phase_names[phase]);
        for (int rank = 0; rank < count; ++rank)
            fprintf(file, "%s%.6f", rank ? ", " : "", ranks[rank].cpu_s[phase]);
    }
    fputs("]}]}\n", file);
    if (ferror(file) | fclose(file))
        fail(EXIT_WRITE, "%s could not be written completely", path);
}

int main(int argc, char **argv)
{
    const char *out = NULL, *json = NULL;
    for (int i = 2; i + 1 < argc; i += 2)
        *(strcmp(argv[i], "--out") == 0 ? &out : &json) = argv[i + 1];
    if (argc < 2 || argc % 2 != 0 || argv[1][0] == '-') {
        fprintf(stderr, "usage: p4est-mesher CASE [--out FOREST] [--json FILE]\n");
        return EXIT_INPUT;
    }
    sc_MPI_Init(&argc, &argv);
    sc_init(sc_MPI_COMM_WORLD, 0, 0, NULL, SC_LP_ERROR);
    p4est_init(NULL, SC_LP_ERROR);

    struct figures own = {0};
    double start = clock_s(CLOCK_MONOTONIC), start_cpu = clock_s(CLOCK_PROCESS_CPUTIME_ID);
    struct job job = read_case(argv[1]);
    struct search search = new_search(&job);
    own.cpu_s[READ] = clock_s(CLOCK_PROCESS_CPUTIME_ID) - start_cpu;
    p8est_connectivity_t *cube = p8est_connectivity_new_unitcube();
    p8est_t *forest = p8est_new_ext(sc_MPI_COMM_WORLD, cube, 0, 0, 0, 0, NULL, &search);
    refine(forest, own.cpu_s);
    balance(forest, own.cpu_s);
    own.time_wall_s = clock_s(CLOCK_MONOTONIC) - start;

    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    own.peak_rss_bytes = (uint64_t) usage.ru_maxrss * 1024;
    if (out != NULL)
        p8est_save(out, forest, 0);
    if (json != NULL) {
        struct figures *all = malloc((size_t) forest->mpisize * sizeof own);
        sc_MPI_Gather(&own, sizeof own, sc_MPI_BYTE, all, sizeof own, sc_MPI_BYTE, 0, sc_MPI_COMM_WORLD);
        if (forest->mpirank == 0)
            write_json(json, all, forest->mpisize, forest, search.tree.facets.count);
        free(all);
    }
    p8est_destroy(forest);
    p8est_connectivity_destroy(cube);
    sc_finalize();
    sc_MPI_Finalize();
    return 0;
}
