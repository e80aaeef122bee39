(* check MESH BASE: whether the mesh directory MESH is proven right, given T0 with its sides in the directory BASE (mesher --ungraded).

   This file is trusted, not proven: it reads both manifests and maps all parts into memory. Exit codes: 0 accepted, 1 rejected, 2 unusable
   input. *)
open Checker

exception Unusable of string
let unusable fmt = Printf.ksprintf (fun s -> raise (Unusable s)) fmt

(* JSON, as far as manifests use it. Numbers stay text: those that are not integers are only compared. *)
type json = Null | Bool of bool | Number of string | Text of string | List of json list | Object of (string * json) list

let parse_json file text =
  let n = String.length text and i = ref 0 in
  let fail () = unusable "%s: no JSON at byte %d" file !i in
  let rec skip () = if !i < n && String.contains " \t\r\n" text.[!i] then (incr i; skip ()) in
  let peek () = skip (); if !i < n then text.[!i] else fail () in
  let expect c = if peek () = c then incr i else fail () in
  let word w v = if !i + String.length w <= n && String.sub text !i (String.length w) = w then (i := !i + String.length w; v) else fail () in
  let text_value () =
    expect '"';
    let b = Buffer.create 16 in
    while (if !i < n then text.[!i] else fail ()) <> '"' do
      if text.[!i] = '\\' then (Buffer.add_char b '\\'; incr i; if !i >= n then fail ());
      Buffer.add_char b text.[!i]; incr i
    done;
    incr i; Buffer.contents b in
  let rec items close item = if peek () = close then (incr i; []) else
    let first = item () in
    if peek () = ',' then (incr i; if peek () = close then fail () else first :: items close item) else (expect close; [first]) in
  let rec value () = match peek () with
    | '"' -> Text (text_value ())
    | '{' -> incr i; Object (items '}' (fun () -> skip (); let k = text_value () in expect ':'; (k, value ())))
    | '[' -> incr i; List (items ']' value)
    | 't' -> word "true" (Bool true) | 'f' -> word "false" (Bool false) | 'n' -> word "null" Null
    | _ ->
      let start = !i in
      while !i < n && String.contains "+-.0123456789eE" text.[!i] do incr i done;
      if !i = start then fail () else Number (String.sub text start (!i - start)) in
  let v = value () in
  skip (); if !i <> n then fail () else v

let read_text file =
  try
    let c = open_in_bin file in
    Fun.protect ~finally:(fun () -> close_in c) (fun () -> really_input_string c (in_channel_length c))
  with Sys_error e -> unusable "%s" e

(* A manifest, its directory, and what it has by name. *)
let field file name = function
  | Object fields -> (match List.filter (fun (k, _) -> k = name) fields with
    | [_, v] -> Some v | [] -> None | _ -> unusable "%s: the key %s occurs twice" file name)
  | _ -> unusable "%s: not an object" file
let get file name v = match field file name v with Some v -> v | None -> unusable "%s: the key %s is missing" file name
let integer file = function
  | Number s -> (match int_of_string_opt s with Some n -> n | None -> unusable "%s: %s is not an integer" file s)
  | _ -> unusable "%s: not a number" file
let list file = function List l -> l | _ -> unusable "%s: not a list" file

type words = (int64, Bigarray.int64_elt, Bigarray.c_layout) Bigarray.Array1.t

(* The words of a .npy file, mapped. *)
let map file : words =
  let fd = try Unix.openfile file [Unix.O_RDONLY] 0 with Unix.Unix_error (e, _, _) -> unusable "%s: %s" file (Unix.error_message e) in
  Fun.protect ~finally:(fun () -> Unix.close fd) @@ fun () ->
  let head = Bytes.make 4096 ' ' in
  let got = Unix.read fd head 0 4096 in
  if got < 10 || Bytes.sub_string head 0 8 <> "\x93NUMPY\x01\x00" then unusable "%s: not a .npy file of version 1" file;
  let start = 10 + Bytes.get_uint16_le head 8 in
  if start > got then unusable "%s: the header is too long" file;
  let header = String.concat "" (String.split_on_char ' ' (Bytes.sub_string head 10 (start - 10))) in
  let count = try Scanf.sscanf header "{'descr':'<u8','fortran_order':False,'shape':(%u,),}" (fun n -> n)
    with _ -> unusable "%s: not a one-dimensional array of u64" file in
  if (Unix.LargeFile.fstat fd).Unix.LargeFile.st_size <> Int64.of_int (start + 8 * count) then unusable "%s: not as long as its shape" file;
  if count = 0 then Bigarray.Array1.create Bigarray.int64 Bigarray.c_layout 0
  else Bigarray.array1_of_genarray (Unix.map_file fd ~pos:(Int64.of_int start) Bigarray.int64 Bigarray.c_layout false [| count |])

let part (a : words) : part =
  { count = Bigarray.Array1.dim a;
    key = (fun i -> Int64.to_int (Int64.shift_right_logical (Bigarray.Array1.get a i) 7));
    code = (fun i -> Int64.to_int (Bigarray.Array1.get a i) land 127) }

let open_set directory tree =
  let file = Filename.concat directory "mesh.json" in
  let m = parse_json file (read_text file) in
  if get file "schema" m <> Text "octree-leaf-set/1" then unusable "%s: not a leaf set" file;
  if get file "tree" m <> Text tree then unusable "%s: the tree is not %S" file tree;
  if field file "sides" m = Some (Text "unknown") then unusable "%s: its leaves have no sides" file;
  let parts = list file (get file "parts" m) in
  if parts = [] && get file "leaves" m <> Number "0" then unusable "%s: its leaves are in no part: write leaf words" file;
  let words = List.map (fun p -> match get file "file" p with
    | Text name -> map (Filename.concat directory name) | _ -> unusable "%s: a part has no name" file) parts in
  let sides = get file "leaves_by_side" m in
  let numbers = { total = integer file (get file "leaves" m);
    by_level = List.map (integer file) (list file (get file "leaves_by_level" m));
    by_side = List.map (fun s -> integer file (get file s sides)) ["outside"; "inside"; "crossing"];
    by_part = List.map (fun p -> integer file (get file "leaves" p)) parts } in
  (file, m, words, numbers)

let inputs (file, m) =
  { surface = integer file (get file "level_surface" m);
    layer_cells = integer file (get file "layer_cells_min" m);
    keep = (match get file "keep" m with
      | Text "outside" -> Keep_outside | Text "inside" -> Keep_inside | Text "all" -> Keep_all | _ -> unusable "%s: keep" file);
    keep_crossing = (match get file "keep_crossing" m with Bool b -> b | _ -> unusable "%s: keep_crossing" file);
    seeds = (match field file "seeds" m with None -> [] | Some s -> List.map (fun s -> match list file s with
      | [p; q; r] -> ((integer file p, integer file q), integer file r) | _ -> unusable "%s: a seed has three coordinates" file) (list file s));
    delete_enclosed = (match field file "enclosed" m with
      | None | Some (Text "delete") -> true | Some (Text "keep") -> false | _ -> unusable "%s: enclosed" file) }

(* Values that are equal however they are written. *)
let rec plain = function
  | Object fields -> Object (List.sort compare (List.map (fun (k, v) -> (k, plain v)) fields))
  | List l -> List (List.map plain l)
  | Number s -> Number (match float_of_string_opt s with Some x -> Printf.sprintf "%h" x | None -> s)
  | v -> v

(* Both directories are of one case. Another program's mesh need not state its geometry. *)
let same_case (f, m) (g, b) =
  List.iter (fun key -> if plain (get f key m) <> plain (get g key b) then unusable "%s and %s differ in %s" f g key) ["root"; "boxes"];
  (match field f "geometry" m, field g "geometry" b with
    | Some v, Some w when plain v <> plain w -> unusable "%s and %s differ in geometry" f g
    | _ -> ());
  if inputs (f, m) <> inputs (g, b) then unusable "%s and %s differ in the surface level, layers, keep, seeds or enclosed" f g

(* The crossing leaves of T0, which are those that were deleted after gradation unless gradation has split some (Offer). *)
let crossing (base : words list) : words list =
  List.map (fun (a : words) ->
    let is_crossing w = Int64.to_int w land 3 = 2 in
    let n = ref 0 in
    for i = 0 to Bigarray.Array1.dim a - 1 do if is_crossing a.{i} then incr n done;
    let c = Bigarray.Array1.create Bigarray.int64 Bigarray.c_layout !n and j = ref 0 in
    for i = 0 to Bigarray.Array1.dim a - 1 do if is_crossing a.{i} then (c.{!j} <- a.{i}; incr j) done;
    c) base

let () =
  (* Trees live to the end, so there is little garbage to collect. *)
  Gc.set { (Gc.get ()) with Gc.minor_heap_size = 1 lsl 20; space_overhead = 1000 };
  try match Sys.argv with
    | [| _; mesh; base |] ->
      let start = Unix.gettimeofday () in
      let file, m, words, of_mesh = open_set mesh "final" and base_file, b, base_words, of_base = open_set base "base" in
      same_case (file, m) (base_file, b);
      let inputs = inputs (file, m) in
      let accepts dropped = check inputs (List.map part base_words) (List.map part words) (List.map part dropped) of_base of_mesh in
      let right = if inputs.keep_crossing then accepts [] else
        let leaves = crossing base_words in
        accepts leaves || accepts (Offer.refined inputs.surface inputs.layer_cells base_words words leaves) in
      Printf.printf "%s: %d leaves, %d of T0, %.2f s\n" (if right then "accepted" else "rejected") of_mesh.total of_base.total
        (Unix.gettimeofday () -. start);
      (* The harness repeats this line, so that no report claims what an older checker does not prove. *)
      if right then print_endline
        "proven, given T0: octants, completeness, sides of components, balance, layers, and that no split is needless or missing; only tested: \
         which leaves facets cross, boxes, and rays";
      exit (if right then 0 else 1)
    | _ -> unusable "usage: check MESH BASE"
  with Unusable s -> prerr_endline s; exit 2
