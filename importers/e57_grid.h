#pragma once
// Which grid the records of a structured E57 scan fill, and which way it lies.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scan.h"
#include "importers/e57_document.h"

namespace roomtex {

// From the row and column indices of the records to cells of a grid.
class E57Grid {
 public:
  // Reads the indices of all records. The size is that of indexBounds, if they hold all records;
  // otherwise that of the indices that occur; rows and columns without any record (of a thinned
  // scan) are left out if the grid would be almost empty. None if it is almost empty all the same:
  // memory follows the records. Throws InputError with the byte.
  static std::optional<E57Grid> Find(const E57Pages& pages, const E57Scan& scan,
                                     std::vector<std::string>* notes);

  int num_rows() const { return rows_.count; }
  int num_columns() const { return columns_.count; }
  // -1 for what is no index (fields of floats may be NaN).
  int RowOf(double index) const { return rows_.Of(index); }
  int ColumnOf(double index) const { return columns_.Of(index); }

 private:
  struct Axis {
    double first = 0;
    int count = 0;
    std::vector<double> indices;  // in order, if not all from `first` on

    int Of(double index) const;
  };
  Axis rows_, columns_;
};

// Turns the grid of a scan so that the rows lie above each other, with the highest on top: rows and
// columns are exchanged, rows turned round as the angles from the station show it.
void StandUpright(Scan* scan);

}  // namespace roomtex
