% Read what gp-labeler writes, in GNU Octave 7 or newer, and in MATLAB R2016b or newer (not run there).
%   [names, points, pose] = read_files("GP01_L.mrk.json", "pose.json")
% names: cell array; points: N x 3, mm, LPS, NaN where a feature is not placed; pose: struct.
function [names, points, pose] = read_files(landmarks, estimate)
  markup = jsondecode(fileread(landmarks)).markups(1);
  controls = markup.controlPoints;
  if ~iscell(controls), controls = num2cell(controls); end
  n = numel(controls);
  names = cell(n, 1);
  points = nan(n, 3);
  for i = 1:n
    names{i} = controls{i}.label;
    if strcmp(controls{i}.positionStatus, "defined")
      points(i, :) = controls{i}.position(:)';
    end
  end
  told = jsondecode(fileread(estimate));
  pose.origin = told.cochlea_origin_mm(:)';   % mm, in the frame of the touches
  pose.axis = told.modiolar_axis(:)';         % unit vector CB->CA
  pose.transform = told.transform;            % 4 x 4, cochlea to the frame of the touches
end
