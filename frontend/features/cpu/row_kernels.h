#pragma once

#include <cstddef>
#include <cstdint>

// What the CPU engine does with whole rows of samples, in vectors of what the machine has. Rows of
// floats can be read and written up to kRowPadding samples beyond `width`; what stands there is of
// no account.

namespace hybrid_slam::sift {

constexpr std::size_t kRowPadding = 16;

// out[x] = sum over i of weights[i] * rows[i][x], for symmetric weights (weights[i] = weights[count
// - 1 - i]). Rows of an image make a blur along its columns, one row shifted along itself (rows[i]
// = row + i - count / 2) a blur along the row. `out` is none of the rows.
void symmetric_sum(const float* const* rows, std::size_t count, const float* weights,
                   std::size_t width, float* out);

// Rows that are blurred along their columns at once, so that each row is read once for all of them.
constexpr std::size_t kBlockRows = 4;

// For j = 0 .. kBlockRows - 1: out[j][x] = sum over i of weights[i] * rows[j + i][x], for symmetric
// weights, an odd number of them. There are count + kBlockRows - 1 rows, none of which is written
// to.
void sum_columns(const float* const* rows, std::size_t count, const float* weights,
                 std::size_t width, float* const* out);

// out[x] = sum over i of weights[i] * row[x + i], for symmetric weights, an odd number of them, and
// difference[x] = out[x] - below[x].
void symmetric_sum_and_difference(const float* row, std::size_t count, const float* weights,
                                  std::size_t width, float* out, const float* below,
                                  float* difference);

// out[x] = in[x].
void to_floats(const std::uint8_t* in, std::size_t width, float* out);

// out[x] = in[x] * kLevelUnits (definition/patch.h), rounded, for values of 0 to 255. Writes
// `width` samples, no more.
void to_fixed_point(const float* in, std::size_t width, std::uint16_t* out);

// out[x] = in[x] / kLevelUnits. Reads `width` samples, no more.
void from_fixed_point(const std::uint16_t* in, std::size_t width, float* out);

// out[2 x] = even[x], out[2 x + 1] = odd[x], 2 * width samples.
void interleave(const float* even, const float* odd, std::size_t width, float* out);

// What the search for extrema compares a sample with, made once for a row of all layers: for layer
// l = 0 .. layers - 1 the least and the largest of the nine samples in a column that three rows of
// three differences hold, rows[3 * l] .. rows[3 * l + 8]. There are 3 * (layers + 2) rows.
void column_ranges(const float* const* rows, std::size_t layers, std::size_t width,
                   float* const* smallest, float* const* largest);

// Columns x of first .. last - 1, ascending, whose neighbourhood (definition/extremum.h; rows[i]
// points at column 0) is an extremum with |value| > threshold, which is not negative. `smallest`
// and `largest` are the ranges of the same nine rows. `found` has room for last - first columns;
// returns how many there are.
std::size_t find_extrema(const float* const* rows, const float* smallest, const float* largest,
                         std::size_t first, std::size_t last, float threshold, int* found);

}  // namespace hybrid_slam::sift
