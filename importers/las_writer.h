#pragma once
// Writes LAS 1.2, 1.3 and 1.4 (ASPRS, "LAS Specification 1.4 - R15", 2019; las.h reads them).

#include <string>
#include <vector>

#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct LasWriterOptions {
  std::string version = "1.2";  // what everything reads

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// All measured points of all scans: 1.2 and 1.3 of point format 0, or 2 where a scan has colours;
// 1.4 of formats 6 and 7. Whole tenths of a millimetre about whole metres; intensities from 0 to 1
// become 0 to 65535, others are rounded, and scaled where they are larger than that; colours have
// 16 bits. coordinate_system: OGC WKT, "" = not known; goes into a 1.4 alone, older versions know
// none. Throws InputError: cannot be written, too many points for the version.
void WriteLas(const std::vector<const Scan*>& scans, const std::string& path,
              const LasWriterOptions& options = {}, const std::string& coordinate_system = "");

}  // namespace roomtex
