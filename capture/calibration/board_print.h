#pragma once
// Boards to print.

#include <string>

#include "capture/calibration/board.h"

namespace roomtex {

// A PDF of one page with the board in its true size (squares of Board::square), on the smallest of
// A4 to A0 that holds it with a margin of 10 mm, else on a page of its own; a line below says what
// it is. Throws InputError if it cannot be written, or if a side is longer than 5 m.
void WriteBoardPdf(const Board& board, const std::string& path);

}  // namespace roomtex
