#pragma once
// What every command owes to its options.

#include <string>
#include <vector>

#include "core/option_fields.h"

namespace roomtex {

// Expects, of a built command and all fields it takes,
// - that --help lists every field, and every option that a sentence or the help of a field names;
// - that it refuses numbers beyond the fields' bounds (exit 2), with a sentence for each;
// - that it refuses "nonsense" for every option of --help that is no free text.
// arguments: what the command cannot do without, e.g. "--input_path none --output_path none": no
// option is believed before all are checked, so nothing has to be there.
void ExpectChecksItsOptions(const std::string& command, const std::string& arguments,
                            const std::vector<OptionFields>& fields);

}  // namespace roomtex
