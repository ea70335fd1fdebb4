function [T_tracker_cochlea, answer] = estimate_matlab(touches, side, port)
%ESTIMATE_MATLAB Ask gp-core serve for the pose of a cochlea. NOT RUN: there is no MATLAB where this is tested.
%   touches: struct with a field for each feature, [x y z] or one row a touch, mm, tracker frame.
%   T = estimate_matlab(struct('CL', [1 2 3], ...), 'L')
%   A pose that is withheld (HTTP 409) and a wrong request (400) are errors.
    if nargin < 3, port = 18950; end
    request = struct('side', side, 'touches', touches);
    options = weboptions('MediaType', 'application/json', 'ContentType', 'json', 'Timeout', 30);
    url = sprintf('http://127.0.0.1:%d/estimate', port);
    answer = webwrite(url, jsonencode(request), options);
    assert(answer.status == 0, 'the pose is withheld');
    T_tracker_cochlea = answer.transform;
end
