#pragma once
// A small web server for one person at one machine: what roomtex-pick and roomtex-view serve their
// pages with. Built on cpp-httplib, behind a gate of our own (see local_server.cc).
//
// Who may ask. The photos of a scene are nobody else's business, and a page of another site must
// not be able to make our browser change picks. Every request therefore needs
// - the token: 160 random bits of the operating system, the first part of every path. A path and no
//   cookie: a cookie is sent along by the browser whoever asks, and goes to every port of the host;
//   what stands in the path only a page that was opened with it can send (relative URLs do).
// - a Host header that names an address we are bound to (DNS rebinding);
// - no Origin but our own; requests that change something must carry it (cross-site posts).
// Reachable is what was added under exactly that path, nothing else: no path ever becomes a file
// name.

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

class OptionFields;

struct LocalServerOptions {
  std::string host = "127.0.0.1";  // address to bind
  int port = 8080;                 // 0 = any free one
  bool port_may_differ = false;    // any free one when the port is taken; LetPortDiffer()
  bool allow_remote = false;       // a host that other computers reach needs this
  bool open = false;               // the command opens the URL in the browser
  std::string token;  // KeptToken(), for addresses that outlive the server; "" = a new one

  int max_body_bytes = 1 << 20;     // larger requests: 413
  int max_header_bytes = 16 << 10;  // request line and header together; larger: 431
  int num_threads = 32;             // requests answered side by side; a browser opens six
  double request_seconds = 20;      // for a request to arrive whole; slower: 408
  double idle_seconds = 10;         // a connection without a request is closed
  double stall_seconds = 30;        // an answer of which nothing is taken is given up

  void Declare(OptionFields* fields);
  // Also finds out whether the host is of this machine and whether others reach it.
  std::vector<std::string> Problems() const;
};

// Two commands with pages stand side by side: a port that the user did not ask for, neither on the
// command line nor in a file, gives way when it is taken.
void LetPortDiffer(int argc, char** argv, LocalServerOptions* options);

class LocalServer {
 public:
  using Query = std::map<std::string, std::string>;  // ?name=value, decoded; first of a name wins
  // Something that is not JSON: a tile, a GLB.
  struct Content {
    std::shared_ptr<const std::string> bytes;
    std::string type;  // e.g. "image/jpeg"
    std::string etag;  // of these bytes, without quotes; "" = none
    // The same for this URL as long as the server runs: no asking again, unless the address
    // outlives the server.
    bool immutable = false;
  };

  // Throws UsageError with all problems of the options.
  explicit LocalServer(const LocalServerOptions& options);
  ~LocalServer();  // stops and waits

  // What is reachable, to be said before Start(). Paths begin with "/" and are without the token:
  // "/" is the page, "/pick.js" an asset of it, "/tile" a handler. Assets are scripts, styles and
  // the like, sent compressed; large bytes are AddContent's, which does not copy them. A page says
  // its URLs relative and names an icon (data:,), because /favicon.ico lacks the token; it changes
  // things by fetch() with Content-Type application/json.
  //
  // Handlers run in parallel on several threads, the same one as well: guard what they share. An
  // InputError or UsageError becomes 422 with {"error": sentence}, any other exception 500; the
  // server goes on. A handler that takes long should look at stopping().
  void AddAsset(const std::string& path, const std::string& type, std::string bytes);
  void AddJson(const std::string& path, std::function<Json(const Query&)> handler);  // GET
  // GET; nullopt: 404.
  void AddContent(const std::string& path,
                  std::function<std::optional<Content>(const Query&)> handler);
  void AddPost(const std::string& path, std::function<Json(const Json&)> handler);
  void AddPut(const std::string& path, std::function<Json(const Json&)> handler);
  void AddDelete(const std::string& path, std::function<Json(const Json&)> handler);

  // Binds and begins to answer. stop_on_signals: SIGINT and SIGTERM stop (a second one kills), for
  // one server of a process. Throws UsageError when the port is taken (and may not differ) or may
  // not be used.
  void Start(bool stop_on_signals);
  // Returns once the server is to stop and the requests under way are answered.
  void Wait();
  // From any thread, a handler too; does not wait.
  void RequestStop();
  bool stopping() const;

  int port() const;         // the bound one
  std::string Url() const;  // with the token; what the user opens
  // What to type at another computer so that Url() works in its browser.
  std::string SshLine() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
