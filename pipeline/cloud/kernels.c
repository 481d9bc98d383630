/* Passes over large clouds, compiled where the program is installed by .ci/build_kernels.py.

   compiled.py holds their signatures. Each has a fallback in numpy, in selection.py, moments.py or
   voxel_grid.py, which defines what it does. Arrays are contiguous; points are rows of x, y, z in
   double precision, `step` bytes from one to the next, perhaps records of a file, not aligned to
   anything. Nothing is allocated and nothing but memory is read, so that threads may call
   them at once. No fused multiply-adds (-ffp-contract=off): every processor gives the same bits.

   Points are copied in pieces to a buffer that stays in the first cache, and computed on there: a
   plain copy reads large memory at its full rate, a loop that computes may wait for each line. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("avx2", "default"))) /* chosen when it is loaded */
#else
#define WIDE
#endif
#define EXPORT __attribute__((visibility("default")))

enum { PIECE = 1024 /* points: 24 kB */, POINT = 3 * sizeof(double), SUMS = 10, VOXEL_BITS = 21 };

static const double ROUNDED = 1.5 * 4503599627370496.0 / 1048576.0; /* as selection.ROUNDED */

/* The digest of this file that the build names, by which the program knows what it loads. */
EXPORT const char *source_digest(void) { return SOURCE_DIGEST; }

static int64_t smaller(int64_t a, int64_t b) { return a < b ? a : b; }

/* Copy points from a row on to a piece; return how many. */
static int64_t read_piece(const char *points, int64_t step, int64_t count, int64_t start,
                          double *piece)
{
    int64_t rows = smaller(PIECE, count - start);
    points += step * start;
    if (step == POINT)
        memcpy(piece, points, (size_t)rows * POINT);
    else
        for (int64_t i = 0; i < rows; i++)
            memcpy(piece + 3 * i, points + step * i, POINT);
    return rows;
}

static inline uint64_t bits(double x)
{
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

/* Write the hashes of points (selection.coordinate_hash). */
EXPORT WIDE void hash(const double *points, int64_t count, uint64_t *hashes)
{
    const uint64_t zero = bits(ROUNDED);
    for (int64_t i = 0; i < count; i++) {
        uint64_t h = (bits(points[3 * i] + ROUNDED) - zero) * 0x9E3779B97F4A7C15u;
        h ^= (bits(points[3 * i + 1] + ROUNDED) - zero) * 0xC2B2AE3D27D4EB4Fu;
        h ^= (bits(points[3 * i + 2] + ROUNDED) - zero) * 0x165667B19E3779F9u;
        h = (h ^ (h >> 32)) * 0xBF58476D1CE4E5B9u;
        hashes[i] = h ^ (h >> 32);
    }
}

/* Write rows of points with hashes up to the limit, and the hashes; return how many. */
EXPORT int64_t hash_rows(const char *points, int64_t step, int64_t count, uint64_t limit,
                         int64_t *rows, uint64_t *hashes)
{
    double piece[3 * PIECE];
    uint64_t of_piece[PIECE];
    int64_t found = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        hash(piece, n, of_piece);
        for (int64_t i = 0; i < n; i++)
            if (of_piece[i] <= limit) {
                rows[found] = start + i;
                hashes[found++] = of_piece[i];
            }
    }
    return found;
}

/* Write those of ascending rows of points with hashes up to the limit; return how many. */
EXPORT int64_t thin_rows(const char *points, int64_t step, const int32_t *rows, int64_t count,
                         uint64_t limit, int32_t *kept)
{
    double piece[3 * PIECE];
    uint64_t of_piece[PIECE];
    int64_t found = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = smaller(PIECE, count - start);
        for (int64_t i = 0; i < n; i++)
            memcpy(piece + 3 * i, points + step * rows[start + i], POINT);
        hash(piece, n, of_piece);
        for (int64_t i = 0; i < n; i++) {
            kept[found] = rows[start + i];
            found += of_piece[i] <= limit;
        }
    }
    return found;
}

/* Return whether all coordinates are finite and smaller than a limit. */
EXPORT WIDE int64_t all_within(const char *points, int64_t step, int64_t count, double limit)
{
    double piece[3 * PIECE];
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        int64_t outside = 0;
        for (int64_t i = 0; i < 3 * n; i++)
            outside |= !(fabs(piece[i]) < limit);
        if (outside)
            return 0;
    }
    return 1;
}

/* Widen a box, its least and greatest coordinates (2, 3), to hold points. */
EXPORT WIDE void widen(double *corners, const char *points, int64_t step, int64_t count)
{
    double piece[3 * PIECE];
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        for (int64_t i = 0; i < n; i++)
            for (int k = 0; k < 3; k++) {
                double x = piece[3 * i + k];
                corners[k] = x < corners[k] ? x : corners[k];
                corners[3 + k] = x > corners[3 + k] ? x : corners[3 + k];
            }
    }
}

/* Discs about an axis along a plane's normal: reach, depth, slope, most reach (selection.Slab). */
typedef const double *slab;

/* Mark points: 1 within `face`, 2 within `around` but not `face`, else 0. */
WIDE static void mark(const double *points, int64_t count, const double *centre,
                      const double *normal, slab face, slab around, uint8_t *marks)
{
    for (int64_t i = 0; i < count; i++) {
        double x = points[3 * i] - centre[0], y = points[3 * i + 1] - centre[1];
        double z = points[3 * i + 2] - centre[2];
        double depth = fabs(x * normal[0] + y * normal[1] + z * normal[2]);
        double square = x * x + y * y + z * z - depth * depth;
        double r = face[0] + face[2] * depth, q = around[0] + around[2] * depth;
        r = r < face[3] ? r : face[3];
        q = q < around[3] ? q : around[3];
        int on_face = (depth < face[1]) & (square < r * r);
        int beside = (depth < around[1]) & (square < q * q) & !on_face;
        marks[i] = (uint8_t)(on_face | beside << 1);
    }
}

/* Write rows of points in `face` to on_face, other ones in `around` to beside; counts: of each.

   Without branches: points in random order would be mispredicted. */
EXPORT void near_plane(const char *points, int64_t step, int64_t count, const double *centre,
                       const double *normal, slab face, slab around, int32_t *on_face,
                       int32_t *beside, int64_t *counts)
{
    double piece[3 * PIECE];
    uint8_t marks[PIECE];
    int64_t faces = 0, besides = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        mark(piece, n, centre, normal, face, around, marks);
        for (int64_t i = 0; i < n; i++) {
            on_face[faces] = beside[besides] = (int32_t)(start + i);
            faces += marks[i] & 1;
            besides += marks[i] >> 1;
        }
    }
    counts[0] = faces;
    counts[1] = besides;
}

/* Write those rows of points, relative to the centre, to out. */
EXPORT void take(const char *points, int64_t step, const double *centre, const int32_t *rows,
                 int64_t count, double *out)
{
    double point[3];
    for (int64_t j = 0; j < count; j++) {
        memcpy(point, points + step * rows[j], POINT);
        for (int k = 0; k < 3; k++)
            out[3 * j + k] = point[k] - centre[k];
    }
}

/* The same in single precision. */
EXPORT void take_single(const char *points, int64_t step, const double *centre,
                        const int32_t *rows, int64_t count, float *out)
{
    double point[3];
    for (int64_t j = 0; j < count; j++) {
        memcpy(point, points + step * rows[j], POINT);
        for (int k = 0; k < 3; k++)
            out[3 * j + k] = (float)(point[k] - centre[k]);
    }
}

/* Add one point to sums, in the order of moments.sums_by. */
static inline void add(double *cell, double x, double y, double z)
{
    cell[0] += 1.0;
    cell[1] += x;
    cell[2] += y;
    cell[3] += z;
    cell[4] += x * x;
    cell[5] += x * y;
    cell[6] += y * y;
    cell[7] += x * z;
    cell[8] += y * z;
    cell[9] += z * z;
}

static int64_t cell_of(double x, double side, int64_t across)
{
    double c = x / side + 0.5 * (double)across;
    return c <= 0.0 ? 0 : c >= (double)across ? across - 1 : (int64_t)c;
}

/* Add the points near the plane w = height to the sums (across * across, 10) of their cells.

   basis: rows u, v, w. Points between both limits go to edge (N, 3); returns how many. sides: rows
   (a, b, c), a u + b v < c; holes: rows (u, v, radius); side: a cell's. */
EXPORT int64_t slab_moments(const char *points, int64_t step, int64_t count, const double *basis,
                            double height, const double *limits, double radius, const double *sides,
                            int64_t side_count, const double *holes, int64_t hole_count,
                            int64_t across, double side, double *sums, double *edge)
{
    double piece[3 * PIECE];
    int64_t found = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        for (int64_t i = 0; i < n; i++) {
            double x = piece[3 * i], y = piece[3 * i + 1], z = piece[3 * i + 2];
            double w = basis[6] * x + basis[7] * y + basis[8] * z;
            double u = basis[0] * x + basis[1] * y + basis[2] * z;
            double v = basis[3] * x + basis[4] * y + basis[5] * z;
            double off = fabs(w - height);
            if (off >= limits[1] || u * u + v * v >= radius * radius)
                continue;
            int outside = 0;
            for (int64_t k = 0; k < side_count; k++)
                outside |= sides[3 * k] * u + sides[3 * k + 1] * v >= sides[3 * k + 2];
            for (int64_t k = 0; k < hole_count; k++) {
                double du = u - holes[3 * k], dv = v - holes[3 * k + 1], r = holes[3 * k + 2];
                outside |= du * du + dv * dv <= r * r;
            }
            if (outside)
                continue;
            if (off >= limits[0]) {
                double *row = edge + 3 * found++;
                row[0] = u;
                row[1] = v;
                row[2] = w;
                continue;
            }
            int64_t cell = cell_of(v, side, across) * across + cell_of(u, side, across);
            add(sums + SUMS * cell, u, v, w);
        }
    }
    return found;
}

/* Add points (3, count) to the sums (cells, width) of a raster's cells (moments.raster_sums).

   along: (2, count) coordinates along its columns and rows; extra: (count), where width is 6. */
EXPORT void raster_sums(const double *uvw, const double *extra, const double *along, int64_t count,
                        int64_t columns, int64_t rows, const double *side, int64_t width,
                        double *sums)
{
    for (int64_t i = 0; i < count; i++) {
        int64_t column = cell_of(along[i], side[0], columns);
        int64_t row = cell_of(along[count + i], side[1], rows);
        double *cell = sums + width * (row * columns + column);
        double w = uvw[2 * count + i];
        cell[0] += 1.0;
        cell[1] += uvw[i];
        cell[2] += uvw[count + i];
        cell[3] += w;
        cell[4] += w * w;
        if (width > 5)
            cell[5] += extra[i];
    }
}

/* Voxels of the points of a piece: keys as voxel_grid.voxel_key, and the points relative to the
   middle of theirs, axis by axis. */
typedef struct {
    int64_t key[PIECE];
    double offset[3][PIECE];
} voxels;

/* Find the voxels of points, all above low and below 2^VOXEL_BITS voxels. */
WIDE static void find_voxels(const double *points, int64_t count, const double *low, double edge,
                             voxels *found)
{
    const double per_edge = 1.0 / edge;
    memset(found->key, 0, sizeof found->key);
    for (int k = 0; k < 3; k++) {
        double *offset = found->offset[k], least = low[k];
        for (int64_t i = 0; i < count; i++)
            offset[i] = points[3 * i + k];
        for (int64_t i = 0; i < count; i++) {
            double place = (offset[i] - least) * per_edge;
            int32_t index = (int32_t)place;
            offset[i] = (place - (double)index - 0.5) * edge;
            found->key[i] = found->key[i] << VOXEL_BITS | index;
        }
    }
}

/* Add points first to last of a piece, all of one voxel, to its sums. */
static inline void add_run(double *cell, const voxels *of, int64_t first, int64_t last)
{
    double n = cell[0], sx = cell[1], sy = cell[2], sz = cell[3], xx = cell[4], xy = cell[5];
    double yy = cell[6], xz = cell[7], yz = cell[8], zz = cell[9];
    for (int64_t i = first; i < last; i++) {
        double x = of->offset[0][i], y = of->offset[1][i], z = of->offset[2][i];
        n += 1.0;
        sx += x;
        sy += y;
        sz += z;
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xz += x * z;
        yz += y * z;
        zz += z * z;
    }
    const double sums[SUMS] = {n, sx, sy, sz, xx, xy, yy, xz, yz, zz};
    memcpy(cell, sums, sizeof sums);
}

/* Return where the search for a key in a hash table begins. */
static inline int64_t slot_of(int64_t key, int64_t mask)
{
    return (int64_t)((uint64_t)key * 0x9E3779B97F4A7C15u >> 32) & mask;
}

/* Add points, all above low, to the sums (room, 10) of their voxels, about the middle of each.

   keys: (room,) of the voxels, in the order in which they appear. slots: (capacity,) a hash table
   with linear probing, a power of two: the row of a voxel, -1 where free. Returns the number of
   voxels, or -1 where there is no more room. Neighbours in a file mostly share a voxel, whose sums
   stay in registers. run_starts, run_rows: (most_runs,) the first of such points, and the row of
   their voxel; runs: how many there are, perhaps more than there is room for. */
EXPORT int64_t voxel_moments(const char *points, int64_t step, int64_t count, const double *low,
                             double edge, int32_t *slots, int64_t capacity, int64_t *keys,
                             double *sums, int64_t room, int32_t *run_starts, int32_t *run_rows,
                             int64_t most_runs, int64_t *runs)
{
    double piece[3 * PIECE];
    voxels of;
    int64_t used = 0, mask = capacity - 1, last = -1;
    *runs = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        find_voxels(piece, n, low, edge, &of);
        for (int64_t i = 0; i < n;) {
            int64_t key = of.key[i], slot = slot_of(key, mask);
            while (slots[slot] != -1 && keys[slots[slot]] != key)
                slot = (slot + 1) & mask;
            if (slots[slot] == -1) {
                if (used == room)
                    return -1;
                keys[used] = key;
                memset(sums + SUMS * used, 0, SUMS * sizeof(double));
                slots[slot] = (int32_t)used++;
            }
            int64_t first = i;
            if (key != last) {
                if (*runs < most_runs) {
                    run_starts[*runs] = (int32_t)(start + first);
                    run_rows[*runs] = slots[slot];
                }
                (*runs)++;
                last = key;
            }
            while (i < n && of.key[i] == key)
                i++;
            add_run(sums + SUMS * (int64_t)slots[slot], &of, first, i);
        }
    }
    return used;
}

/* A voxel's number of a point, as voxel_grid.voxel_key. */
static inline int64_t voxel_of(const double *point, const double *low, double per_edge)
{
    int64_t index[3];
    for (int k = 0; k < 3; k++)
        index[k] = (int64_t)((point[k] - low[k]) * per_edge);
    return index[0] << 2 * VOXEL_BITS | index[1] << VOXEL_BITS | index[2];
}

/* Mark points, all above low, within voxels of a hash table of keys; return how many. */
EXPORT int64_t in_voxels(const char *points, int64_t step, int64_t count, const double *low,
                         double edge, const int64_t *keys, int64_t capacity, uint8_t *marked)
{
    double piece[3 * PIECE];
    int64_t found = 0, last = -2, mask = capacity - 1;
    uint8_t inside = 0;
    for (int64_t start = 0; start < count; start += PIECE) {
        int64_t n = read_piece(points, step, count, start, piece);
        for (int64_t i = 0; i < n; i++) {
            int64_t key = voxel_of(piece + 3 * i, low, 1.0 / edge);
            if (key != last) {
                int64_t slot = slot_of(key, mask);
                while (keys[slot] != -1 && keys[slot] != key)
                    slot = (slot + 1) & mask;
                inside = keys[slot] == key;
                last = key;
            }
            marked[start + i] = inside;
            found += inside;
        }
    }
    return found;
}
