% Ask gp-core serve for the pose of a cochlea: GNU Octave 7 or newer, with curl.
%   octave --no-gui estimate.m 18950 touches.csv L
% touches.csv: lines name,x,y,z, millimetres in the tracker's frame. It prints T_tracker_cochlea, mm, four rows, and
% ends with 0 if the pose may be used, 3 if it is withheld, and 2 if the request is wrong.
args = argv ();
port = args{end - 2};
request.side = args{end};
lines = strsplit (strtrim (fileread (args{end - 1})), "\n");
for i = 1:numel (lines)
  row = strsplit (strtrim (lines{i}), ",");
  if numel (row) == 4 && ! strcmp (row{1}, "name")
    request.touches.(row{1}) = cellfun (@str2double, row(2:4));
  endif
endfor
file = tempname ();
fid = fopen (file, "w");
fputs (fid, jsonencode (request));
fclose (fid);
command = ["curl -s --max-time 30 -w '\\n%{http_code}' --data-binary @" file " http://127.0.0.1:" port "/estimate"];
[~, text] = system (command);
delete (file);
cut = rindex (text, "\n");
http = str2double (text(cut + 1:end));
answer = jsondecode (text(1:cut - 1));
if http == 200
  printf ("%.17g %.17g %.17g %.17g\n", answer.transform');
  exit (0);
elseif http == 409
  fprintf (stderr, "withheld: %s\n", answer.reasons(1).text);
  exit (3);
else
  fprintf (stderr, "%s\n", answer.error.problem);
  exit (2);
endif
