#pragma once
// What LocalServer answers: JSON, files, refusals; for local_server*.cc only.

#include <exception>
#include <optional>
#include <string>

#include "core/local_server_http.h"
#include "core/report.h"

namespace roomtex {

inline constexpr char kLacksToken[] =
    "The address lacks the token; open the address that the command has printed.";
// For people who open a link that was copied, or kept from an earlier run.
std::string RefusalPage();

void SetJson(httplib::Response& response, int status, const std::string& text);
void SetError(httplib::Response& response, int status, const std::string& sentence);
// Whatever a handler throws becomes an answer.
void SetException(httplib::Response& response, const std::exception_ptr& thrown);
void SetContent(const httplib::Request& request, const LocalServer::Content& content,
                httplib::Response& response);

bool IsJson(const httplib::Request& request);
LocalServer::Query QueryOf(const httplib::Request& request);
// None if the text is no JSON or nested too deeply.
std::optional<Json> ParseBody(const std::string& text);
std::string Dump(const Json& json);
// httplib's routes are regular expressions.
std::string Literally(const std::string& path);

}  // namespace roomtex
